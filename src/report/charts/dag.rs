//! The graph of stages: columns by depth, arrows from what is read to what reads it.

use std::collections::BTreeMap;

use crate::pipeline::event::Counts;

use super::svg::{Anchor, Svg, short};

/// A stage of a pipeline, over however many maps.
#[derive(Debug, Clone, PartialEq)]
pub struct StageBox {
    /// Name of the stage.
    pub name: String,
    /// What is written below the name.
    pub uses: String,
    /// How its nodes ended.
    pub note: String,
    /// How long they took.
    pub time: String,
    /// How many of its nodes fared how.
    pub counts: Counts,
    /// Positions of the stages it reads.
    pub inputs: Vec<usize>,
}

const BOX: [f64; 2] = [134.0, 78.0];
const GAP: [f64; 2] = [30.0, 18.0];
/// Room that an arrow takes up which passes a column.
const LANE: f64 = 14.0;
const SWEEPS: usize = 8;

/// A stage in a column, or an arrow that passes it.
#[derive(Debug, Clone, Copy)]
struct Place {
    stage: Option<usize>,
    y: f64,
}

/// Draws the stages; an arrow that is implied by others is left out.
#[must_use]
pub fn dag(stages: &[StageBox]) -> String {
    let layout = Layout::of(stages);
    let mut svg = Svg::new(layout.width() + 4.0, layout.height() + 4.0);
    svg.raw(format_args!(
        "<defs><marker id=\"arrow\" viewBox=\"0 0 8 8\" refX=\"7\" refY=\"4\" markerWidth=\"7\" markerHeight=\"7\" \
         orient=\"auto\"><path d=\"M0 0L8 4L0 8z\" class=\"tip\"/></marker></defs>"
    ));
    for (from, to) in &layout.edges {
        layout.arrow(&mut svg, *from, *to);
    }
    for (column, places) in layout.columns.iter().enumerate() {
        for place in places {
            if let Some(stage) = place.stage {
                draw(&mut svg, &stages[stage], [2.0 + left(column), 2.0 + place.y]);
            }
        }
    }
    svg.finish("the stages of the pipeline")
}

fn left(column: usize) -> f64 {
    column as f64 * (BOX[0] + GAP[0])
}

fn draw(svg: &mut Svg, stage: &StageBox, [x, y]: [f64; 2]) {
    let Counts { ran, hit, failed, skipped, .. } = stage.counts;
    let class = if failed > 0 {
        "stage failed"
    } else if ran > 0 {
        "stage"
    } else {
        "stage quiet"
    };
    svg.rect([x, y, BOX[0], BOX[1]], &format!("class=\"{class}\" rx=\"6\""));
    let middle = x + BOX[0] / 2.0;
    svg.text([middle, y + 19.0], Anchor::Middle, "strong", &cut(&stage.name, 16));
    svg.text([middle, y + 34.0], Anchor::Middle, "tiny muted", &cut(&stage.uses, 24));
    svg.text([middle, y + 49.0], Anchor::Middle, "tiny", &cut(&stage.note, 26));
    svg.text([middle, y + 62.0], Anchor::Middle, "tiny", &stage.time);
    let all = stage.counts.total().max(1) as f64;
    let mut at = x + 8.0;
    for (count, class) in [(ran, "part ran"), (hit, "part hit"), (failed, "part bad"), (skipped, "part left")] {
        let wide = (BOX[0] - 16.0) * count as f64 / all;
        if count > 0 {
            svg.rect([at, y + BOX[1] - 9.0, wide, 4.0], &format!("class=\"{class}\""));
        }
        at += wide;
    }
}

fn cut(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        text.to_owned()
    } else {
        format!("{}…", text.chars().take(most - 1).collect::<String>())
    }
}

/// Points of a path through the columns.
type Spot = (usize, usize);

/// Where stages and passing arrows lie.
struct Layout {
    columns: Vec<Vec<Place>>,
    /// Arrows from one place to another in the next column.
    edges: Vec<(Spot, Spot)>,
}

impl Layout {
    fn of(stages: &[StageBox]) -> Self {
        let depths = depths(stages);
        let mut columns: Vec<Vec<Place>> = vec![Vec::new(); depths.iter().max().map_or(0, |most| most + 1)];
        let mut spots = BTreeMap::new();
        for (stage, depth) in depths.iter().enumerate() {
            spots.insert(stage, (*depth, columns[*depth].len()));
            columns[*depth].push(Place { stage: Some(stage), y: 0.0 });
        }
        let mut edges = Vec::new();
        for (from, to) in reduced(stages) {
            let mut spot = spots[&from];
            for (column, places) in columns.iter_mut().enumerate().take(depths[to]).skip(depths[from] + 1) {
                let next = (column, places.len());
                places.push(Place { stage: None, y: 0.0 });
                edges.push((spot, next));
                spot = next;
            }
            edges.push((spot, spots[&to]));
        }
        let mut layout = Self { columns, edges };
        layout.stack();
        for sweep in 0..SWEEPS {
            layout.settle(sweep % 2 == 0);
        }
        layout
    }

    fn room(place: &Place) -> f64 {
        if place.stage.is_some() { BOX[1] } else { LANE }
    }

    fn middle(&self, (column, row): Spot) -> f64 {
        let place = &self.columns[column][row];
        place.y + Self::room(place) / 2.0
    }

    /// Sets the places of each column below each other.
    fn stack(&mut self) {
        for column in &mut self.columns {
            let mut y = 0.0;
            for place in column {
                place.y = y;
                y += Self::room(place) + GAP[1];
            }
        }
    }

    /// Moves places towards the mean height of their neighbors in the columns before or after, and apart.
    fn settle(&mut self, forward: bool) {
        let count = self.columns.len();
        let order: Vec<usize> =
            if forward { (1..count).collect() } else { (0..count.saturating_sub(1)).rev().collect() };
        for column in order {
            let mut wishes: Vec<(f64, usize)> = (0..self.columns[column].len())
                .map(|row| {
                    let spot = (column, row);
                    let near = self.edges.iter().filter_map(|(from, to)| match forward {
                        true if *to == spot => Some(*from),
                        false if *from == spot => Some(*to),
                        _ => None,
                    });
                    let heights: Vec<f64> = near.map(|spot| self.middle(spot)).collect();
                    let wish = if heights.is_empty() {
                        self.middle(spot)
                    } else {
                        heights.iter().sum::<f64>() / heights.len() as f64
                    };
                    (wish, row)
                })
                .collect();
            wishes.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            self.place(column, &wishes);
        }
        let top = self.columns.iter().flatten().map(|place| place.y).fold(f64::INFINITY, f64::min);
        self.columns.iter_mut().flatten().for_each(|place| place.y -= top);
    }

    /// Gives the places of a column heights near their wishes, in their order, without overlaps.
    fn place(&mut self, column: usize, wishes: &[(f64, usize)]) {
        let places = &mut self.columns[column];
        let room = |row: usize| Self::room(&places[row]);
        // Blocks of touching places share their mean displacement, as in isotonic regression.
        let mut blocks: Vec<(f64, usize)> = Vec::new();
        let mut offsets = Vec::new();
        let mut offset = 0.0;
        for (wish, row) in wishes {
            offsets.push(offset);
            let mut block = (wish - room(*row) / 2.0 - offset, 1);
            while let Some(last) = blocks.last().copied().filter(|last| last.0 > block.0) {
                let size = last.1 + block.1;
                block = ((last.0 * last.1 as f64 + block.0 * block.1 as f64) / size as f64, size);
                blocks.pop();
            }
            blocks.push(block);
            offset += room(*row) + GAP[1];
        }
        let starts = blocks.iter().flat_map(|(start, size)| std::iter::repeat_n(*start, *size));
        for (((_, row), offset), start) in wishes.iter().zip(offsets).zip(starts.collect::<Vec<_>>()) {
            places[*row].y = start + offset;
        }
    }

    fn arrow(&self, svg: &mut Svg, from: Spot, to: Spot) {
        let passes = |spot: Spot| self.columns[spot.0][spot.1].stage.is_none();
        let start = [2.0 + left(from.0) + BOX[0], 2.0 + self.middle(from)];
        let end = [2.0 + left(to.0), 2.0 + self.middle(to)];
        let bend = GAP[0] * 0.6;
        let mut path = String::new();
        if passes(from) {
            path.push_str(&format!("M{} {}H{}", short(start[0] - BOX[0]), short(start[1]), short(start[0])));
        } else {
            path.push_str(&format!("M{} {}", short(start[0]), short(start[1])));
        }
        let (c1, c2) = (start[0] + bend, end[0] - bend);
        path.push_str(&format!(
            "C{} {} {} {} {} {}",
            short(c1),
            short(start[1]),
            short(c2),
            short(end[1]),
            short(end[0]),
            short(end[1])
        ));
        let tip = if passes(to) { "" } else { " marker-end=\"url(#arrow)\"" };
        svg.path(&path, &format!("class=\"arrow\"{tip}"));
    }

    fn width(&self) -> f64 {
        left(self.columns.len()) - if self.columns.is_empty() { 0.0 } else { GAP[0] }
    }

    fn height(&self) -> f64 {
        self.columns.iter().flatten().map(|place| place.y + Self::room(place)).fold(0.0, f64::max)
    }
}

/// Returns for each stage the length of the longest way to it; a cycle, which no pipeline has, ends somewhere.
fn depths(stages: &[StageBox]) -> Vec<usize> {
    let mut depths = vec![0; stages.len()];
    for _ in 0..stages.len() {
        let mut changed = false;
        for (i, stage) in stages.iter().enumerate() {
            let depth =
                stage.inputs.iter().filter(|input| **input != i).map(|input| depths[*input] + 1).max().unwrap_or(0);
            if depth > depths[i] && depth < stages.len() {
                depths[i] = depth;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    depths
}

/// Returns the edges without those that a longer way implies.
fn reduced(stages: &[StageBox]) -> Vec<(usize, usize)> {
    let reaches = |from: usize, to: usize| {
        let (mut seen, mut stack) = (vec![false; stages.len()], vec![to]);
        while let Some(at) = stack.pop() {
            for input in &stages[at].inputs {
                if *input == from {
                    return true;
                }
                if !std::mem::replace(&mut seen[*input], true) {
                    stack.push(*input);
                }
            }
        }
        false
    };
    let mut edges = Vec::new();
    for (to, stage) in stages.iter().enumerate() {
        for from in stage.inputs.iter().filter(|from| **from != to) {
            if !stage.inputs.iter().any(|other| other != from && *other != to && reaches(*from, *other)) {
                edges.push((*from, to));
            }
        }
    }
    edges
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stages(inputs: &[&[usize]]) -> Vec<StageBox> {
        let stage = |(i, inputs): (usize, &&[usize])| StageBox {
            name: format!("s{i}"),
            uses: "use".to_owned(),
            note: "3 ran".to_owned(),
            time: "1 s".to_owned(),
            counts: Counts { ran: 1, hit: 2, ..Counts::default() },
            inputs: inputs.to_vec(),
        };
        inputs.iter().enumerate().map(stage).collect()
    }

    #[test]
    fn arrows_that_others_imply_are_left_out() {
        // maps, walks, visits, labels, trips, costs
        let stages = stages(&[&[], &[0], &[0, 1], &[0, 2], &[0], &[3, 4]]);
        assert_eq!(depths(&stages), [0, 1, 2, 3, 1, 4]);
        assert_eq!(reduced(&stages), [(0, 1), (1, 2), (2, 3), (0, 4), (3, 5), (4, 5)]);
        let svg = dag(&stages);
        // The way from trips (column 1) to costs (column 4) passes two columns.
        assert_eq!(svg.matches("class=\"arrow\"").count(), 8);
        assert_eq!(svg.matches("url(#arrow)").count(), 6);
    }

    #[test]
    fn places_of_a_column_do_not_overlap() {
        let stages = stages(&[&[], &[0], &[0], &[0], &[0], &[1], &[2, 4], &[3], &[4], &[5, 6, 7, 8]]);
        let layout = Layout::of(&stages);
        for column in &layout.columns {
            let mut spans: Vec<(f64, f64)> = column.iter().map(|p| (p.y, p.y + Layout::room(p))).collect();
            spans.sort_by(|a, b| a.0.total_cmp(&b.0));
            assert!(spans.windows(2).all(|pair| pair[1].0 >= pair[0].1 + GAP[1] - 1e-6), "{spans:?}");
            assert!(spans.iter().all(|span| span.0 >= -1e-6));
        }
    }

    #[test]
    fn no_stage_is_no_picture_but_no_panic() {
        assert!(dag(&[]).starts_with("<svg"));
    }
}
