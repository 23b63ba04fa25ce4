//! An artifact as something to look at: facts, a picture, a table.

use std::io::Read;

use crate::domain::crowd::Summary;
use crate::domain::geometry::{Cell, Frame, Grid};
use crate::domain::map::OccupancyMap;
use crate::domain::planner::{Chooser, Trials, savings};
use crate::domain::quantize::{ClassCounts, Labels, OBSTACLE, UNLABELED, class_weights};
use crate::domain::raster::VisitCounts;
use crate::domain::score::{ClassScores, Measure};
use crate::domain::social::SocialCosts;
use crate::domain::tiles::{Target, Tiles};
use crate::domain::tracks::Tracks;
use crate::domain::unet::Architecture;
use crate::kinds::parquet::{Table, read_any};
use crate::kinds::{
    AnyTable, Checkpoint, Heat, Kind, KindError, Learned, NavEpisodes, Placed, TrackReader, outline, plain_metrics,
};
use crate::store::{Artifact, FileRef, Store};

use super::ReportError;
use super::amounts::{bytes, seconds};
use super::axis::number;
use super::colors;
use super::figures::{figure, measure_name, measured, percent, with_interval};
use super::picture::Picture;
use super::tracks::{self, PathCounter};

/// The most windows on a contact sheet.
const MOST_WINDOWS: usize = 32;

/// The most files that are listed, lines that are shown of a text, and bytes that are looked at for these.
const MOST_FILES: usize = 50;
const MOST_LINES: usize = 8;
const HEAD: u64 = 2048;

/// An artifact as something to look at.
#[derive(Debug)]
pub struct Shown {
    facts: Vec<(String, String)>,
    picture: Option<Picture>,
    table: Option<AnyTable>,
}

impl Shown {
    /// Reads an artifact of a kind.
    ///
    /// # Errors
    /// [`ReportError`] if it is not in the store or damaged.
    pub fn of(store: &Store, kind: &str, artifact: &Artifact) -> Result<Self, ReportError> {
        match kind {
            "OccupancyMap" => Ok(Self::map(&Kind::read(store, artifact)?)),
            "VisitCounts" => Ok(Self::visits(&Kind::read(store, artifact)?)),
            "Labels" => Ok(Self::labels(&Kind::read(store, artifact)?)),
            "Heat" => Ok(Self::heat(&Kind::read(store, artifact)?)),
            "Trajectories" => Self::trajectories(store, artifact),
            "NavEpisodes" => Ok(Self::nav_episodes(&Kind::read(store, artifact)?)),
            "Tiles" => Ok(Self::tiles(&Kind::read(store, artifact)?)),
            "Checkpoint" => Self::checkpoint(store, artifact),
            "ClassScores" => Self::with_table(store, artifact, class_scores(&Kind::read(store, artifact)?)),
            "SocialCosts" => Self::with_table(store, artifact, social_costs(&Kind::read(store, artifact)?)),
            "PathTrials" => Self::with_table(store, artifact, path_trials(&Kind::read(store, artifact)?)),
            _ => Self::plain(store, artifact),
        }
    }

    /// Returns names and values of what can be said in a line each.
    #[must_use]
    pub fn facts(&self) -> &[(String, String)] {
        &self.facts
    }

    /// Returns the picture, if it has one.
    #[must_use]
    pub const fn picture(&self) -> Option<&Picture> {
        self.picture.as_ref()
    }

    /// Returns the table, if it is one.
    #[must_use]
    pub const fn table(&self) -> Option<&AnyTable> {
        self.table.as_ref()
    }

    const fn drawn(facts: Vec<(String, String)>, picture: Picture) -> Self {
        Self { facts, picture: Some(picture), table: None }
    }

    fn with_table(store: &Store, artifact: &Artifact, facts: Vec<(String, String)>) -> Result<Self, ReportError> {
        let table = artifact.files.first().map(|file| read_table(store, file)).transpose()?;
        Ok(Self { facts, picture: None, table })
    }

    /// Shows an artifact of a kind of somebody's own as what its files are: a table, or names, sizes and how it begins.
    fn plain(store: &Store, artifact: &Artifact) -> Result<Self, ReportError> {
        let outline = outline(store, artifact);
        let mut facts: Vec<_> =
            plain_metrics(store, artifact)?.iter().map(|(name, value)| fact(name, number(*value))).collect();
        if let ([file], false) = (artifact.files.as_slice(), outline.columns.is_empty()) {
            facts.insert(0, fact("table", format!("{} rows of {} columns", outline.rows, outline.columns.len())));
            return Ok(Self { facts, picture: None, table: Some(read_table(store, file)?) });
        }
        for file in artifact.files.iter().take(MOST_FILES) {
            let name = if file.name.is_empty() { "size" } else { &file.name };
            facts.push(fact(name, bytes(file.bytes)));
        }
        if artifact.files.len() > MOST_FILES {
            facts.push(fact("more files", artifact.files.len() - MOST_FILES));
        }
        if let [file] = artifact.files.as_slice() {
            let head = head(&mut store.open_object(&file.digest)?);
            facts.extend((1..).zip(head).map(|(number, line)| fact(&format!("line {number}"), line)));
        }
        Ok(Self { facts, picture: None, table: None })
    }

    fn map(map: &OccupancyMap) -> Self {
        let mut facts = place(map.frame());
        facts.push(fact(
            "free area",
            format!("{:.1} m² ({})", map.free_area(), share(map.free_cells(), map.free().len())),
        ));
        Self::drawn(facts, Picture::map(map))
    }

    fn visits(placed: &Placed<VisitCounts>) -> Self {
        let counts = placed.value.counts.as_slice();
        let visited = counts.iter().filter(|count| **count > 0).count();
        let mut facts = place(&placed.frame);
        facts.push(fact("paths", placed.value.paths));
        facts.push(fact("visited cells", format!("{visited} ({})", share(visited, counts.len()))));
        facts.push(fact("most visits", counts.iter().max().copied().unwrap_or(0)));
        Self::drawn(facts, visits_picture(placed))
    }

    fn labels(placed: &Placed<Labels>) -> Self {
        let mut facts = place(&placed.frame);
        facts.extend(class_facts(&placed.value.class_counts()));
        Self::drawn(facts, labels_picture(placed))
    }

    fn heat(placed: &Placed<Heat>) -> Self {
        let Heat { free, heat, density, flow, classes } = &placed.value;
        let spread = |grid: &Grid<f32>| {
            let on_free = grid.as_slice().iter().zip(free.as_slice()).filter(|(_, free)| **free);
            let values: Vec<f64> = on_free.map(|(value, _)| f64::from(*value)).collect();
            let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
            format!("mean {}, most {}", number(mean), number(values.iter().copied().fold(0.0, f64::max)))
        };
        let mut facts = place(&placed.frame);
        facts.push(fact("heat", spread(heat)));
        facts.extend(density.iter().map(|density| fact("density", spread(density))));
        facts.extend(flow.iter().map(|flow| fact("flow", format!("in {} directions", flow.len()))));
        if let Some(part) = classes {
            facts.extend(class_facts(&ClassCounts::of(part.count(), part.classes.as_slice())));
        }
        Self::drawn(facts, heat_picture(placed))
    }

    fn trajectories(store: &Store, artifact: &Artifact) -> Result<Self, ReportError> {
        let mut counter: Option<(PathCounter, Frame, f64)> = None;
        let (mut samples, mut episodes, mut agents) = (0u64, 0u64, 0u64);
        let mut last = None;
        for chunk in TrackReader::chunks(store, artifact) {
            let chunk = chunk?;
            let (frame, rate) = (chunk.frame, chunk.frame_rate);
            let (counter, ..) = counter.get_or_insert_with(|| (PathCounter::new(&frame), frame, rate));
            for batch in chunk {
                for sample in &batch? {
                    samples += 1;
                    episodes += u64::from(last.is_none_or(|(episode, _)| episode != sample.episode));
                    agents += u64::from(last != Some((sample.episode, sample.id)));
                    last = Some((sample.episode, sample.id));
                    counter.push(sample);
                }
            }
        }
        let Some((counter, frame, rate)) = counter else {
            return Ok(Self { facts: vec![fact("samples", 0)], picture: None, table: None });
        };
        let mut facts = place(&frame);
        facts.push(fact("episodes", format!("{episodes} with {agents} agents on {} paths", counter.paths())));
        facts.push(fact("samples", format!("{samples} at {} frames/s", number(rate))));
        facts.extend(crowd_summary(store, artifact)?.iter().flat_map(crowd_facts));
        Ok(Self::drawn(facts, counter.finish()))
    }

    fn nav_episodes(placed: &Placed<NavEpisodes>) -> Self {
        let steps = placed.value.steps();
        let lengths = || steps.iter().map(|episode| episode.robot.len());
        let agents = steps.iter().map(|episode| episode.pedestrians.first().map_or(0, Vec::len));
        let mut facts = place(&placed.frame);
        facts.push(fact("episodes", steps.len()));
        facts.push(fact("pedestrians", range(agents)));
        let time = seconds(lengths().max().unwrap_or(0) as f64 / placed.value.frame_rate);
        facts.push(fact("robot path", format!("{} steps, {time}", range(lengths()))));
        facts.extend(placed.value.summary.iter().flat_map(crowd_facts));
        Self::drawn(facts, tracks::episodes(&placed.frame, &placed.value, None))
    }

    fn tiles(tiles: &Tiles) -> Self {
        let mean = tiles.labeled_share.iter().map(|share| f64::from(*share)).sum::<f64>() / tiles.len().max(1) as f64;
        let mut facts = vec![
            fact(
                "windows",
                format!("{} of {} × {} cells on {} maps", tiles.len(), tiles.size, tiles.size, tiles.maps.len()),
            ),
            fact("samples", format!("{} with rotations and mirrorings", tiles.samples())),
            fact("labeled", format!("{:.1} % of a window on average", 100.0 * mean)),
        ];
        facts.extend(tiles.target.class_counts().iter().flat_map(class_facts));
        Self { facts, picture: contact_sheet(tiles), table: None }
    }

    fn checkpoint(store: &Store, artifact: &Artifact) -> Result<Self, ReportError> {
        let checkpoint: Checkpoint = Kind::read(store, artifact)?;
        let config = &checkpoint.config;
        let parameters: usize = checkpoint.state.model.values().map(|array| array.values.len()).sum();
        let list = |values: &[f64]| values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(", ");
        let mut facts = vec![
            fact("epochs", checkpoint.state.epoch),
            fact("parameters", parameters),
            fact("window", format!("{0} × {0} cells", config.window)),
            fact("network", network(&config.network)),
            fact("batch", config.batch),
            fact("learning rate", config.learning_rate),
        ];
        match &config.learned {
            Learned::Classes(counts) => facts.extend([
                fact("classes", counts.classes.len()),
                fact("class distribution", list(&counts.distribution())),
                fact("class weights", list(&class_weights(counts))),
            ]),
            Learned::Ranks { density, flow } => facts.push(fact(
                "learned",
                match (density, flow) {
                    (false, false) => "ranks",
                    (true, false) => "ranks and densities",
                    (false, true) => "ranks and directions of flow",
                    (true, true) => "ranks, densities and directions of flow",
                },
            )),
        }
        if !config.besides.is_empty() {
            let names: Vec<&str> = config.besides.iter().map(|plane| plane.name()).collect();
            facts.push(fact("shown besides free cells", names.join(", ")));
        }
        let table = artifact.file("metrics.parquet").map(|file| read_table(store, file)).transpose()?;
        Ok(Self { facts, picture: None, table })
    }
}

/// Says what a network is like: `32-64-128`, and how many convolutions a level has if there are two.
fn network(network: &Architecture) -> String {
    let widths: Vec<String> = network.widths.iter().map(ToString::to_string).collect();
    let twice = if network.convolutions > 1 { ", two convolutions each" } else { "" };
    format!("levels of {} channels{twice}", widths.join("-"))
}

/// Draws visit counts.
#[must_use]
pub fn visits_picture(placed: &Placed<VisitCounts>) -> Picture {
    let values = placed.value.counts.map(|count| *count as f32);
    Picture::values(placed.frame, values, None, "visits", Some("not visited"))
}

/// Draws labels.
#[must_use]
pub fn labels_picture(placed: &Placed<Labels>) -> Picture {
    Picture::classes(placed.frame, placed.value.classes.clone(), placed.value.count, "not visited")
}

/// Draws the heat of a prediction; where it is a rank, the scale says what that is.
#[must_use]
pub fn heat_picture(placed: &Placed<Heat>) -> Picture {
    let walls = placed.value.free.map(|free| !free);
    let unit = if placed.value.classes.is_some() { "heat" } else { "busier than this share of the floor" };
    Picture::values(placed.frame, placed.value.heat.clone(), Some(walls), unit, None)
}

/// Draws the density of a prediction, if it has one.
pub(super) fn density_picture(placed: &Placed<Heat>) -> Option<Picture> {
    let walls = placed.value.free.map(|free| !free);
    let density = placed.value.density.clone()?;
    Some(Picture::values(placed.frame, density, Some(walls), "people, relative to the building’s mean", None))
}

/// Draws the classes of a prediction, if it has some.
pub(super) fn prediction_picture(placed: &Placed<Heat>) -> Option<Picture> {
    let part = placed.value.classes.as_ref()?;
    Some(Picture::classes(placed.frame, part.classes.clone(), part.count(), "not predicted"))
}

/// Adds up what the files of trajectories say of how they were simulated; `None` if one of them says nothing.
///
/// # Errors
/// [`ReportError`] if a file is missing or damaged.
pub(super) fn crowd_summary(store: &Store, artifact: &Artifact) -> Result<Option<Summary>, ReportError> {
    let mut sum = Summary::default();
    for file in &artifact.files {
        let table = Table::open(Placed::<Tracks>::NAME, Placed::<Tracks>::FORMAT, store.read(&file.digest)?)?;
        let Some(part) = table.text("summary").ok().and_then(|text| serde_json::from_str(text).ok()) else {
            return Ok(None);
        };
        sum += part;
    }
    Ok(Some(sum))
}

fn crowd_facts(summary: &Summary) -> Vec<(String, String)> {
    let mut facts = vec![
        fact("stuck paths", format!("{} of {} ({:.2} %)", summary.stuck, summary.paths, 100.0 * summary.stuck_share())),
        fact("discs in walls", format!("{} of {} positions", summary.tally.wall_hits, summary.tally.agent_steps)),
    ];
    if summary.missing_agents > 0 {
        let asked = summary.agents + summary.missing_agents;
        facts.push(fact("agents without room", format!("{} of {asked}", summary.missing_agents)));
    }
    if summary.near_goals > 0 {
        facts.push(fact("goals nearer than asked", format!("{} of {} paths", summary.near_goals, summary.paths)));
    }
    if summary.waits > 0 {
        facts.push(fact("times without a goal", summary.waits));
    }
    facts
}

/// Sets windows beside each other, evenly spaced among all of them: occupancy above, what is to be learned below.
fn contact_sheet(tiles: &Tiles) -> Option<Picture> {
    let count = tiles.len().min(MOST_WINDOWS);
    if count == 0 {
        return None;
    }
    let (size, gap) = (tiles.size, 3);
    let across = (count as f64 * 2.0).sqrt().ceil() as usize;
    let down = count.div_ceil(across);
    let (wide, high) = (size + gap, 2 * size + 2 * gap + 1);
    let mut pixels = Grid::filled(down * high - gap, across * wide - gap, colors::PAPER);
    let taught = |cell: usize| match &tiles.target {
        Target::Classes { classes, labels } => match labels[cell] {
            OBSTACLE => colors::WALL,
            class if class <= UNLABELED => colors::EMPTY,
            class => colors::class(class, *classes),
        },
        Target::Ranks { rank, .. } if rank[cell] < 0.0 => colors::WALL,
        Target::Ranks { rank, .. } => colors::value(f64::from(rank[cell])),
    };
    let mut put = |window: usize, slot: usize| {
        let (top, left) = (slot / across * high, slot % across * wide);
        for (i, cell) in tiles.cells_of(window).enumerate() {
            let (row, col) = (top + i / size, left + i % size);
            pixels[Cell::new(row, col)] = if tiles.occupancy[cell] > 0 { colors::FREE } else { colors::WALL };
            pixels[Cell::new(row + size + 1, col)] = taught(cell);
        }
    };
    (0..count).for_each(|slot| put(slot * tiles.len() / count, slot));
    let mut legend: Vec<_> = match &tiles.target {
        Target::Classes { classes, .. } => {
            let last = i8::try_from(*classes).expect("at most 16 classes");
            let classes = (1..=last).map(|class| (format!("class {class}"), colors::class(class, *classes)));
            classes.chain([("unlabeled".to_owned(), colors::EMPTY)]).collect()
        }
        Target::Ranks { .. } => [("least visited", 0.0), ("median", 0.5), ("most visited", 1.0)]
            .map(|(n, v)| (n.to_owned(), colors::value(v)))
            .into(),
    };
    legend.extend([("blocked".to_owned(), colors::WALL), ("free".to_owned(), colors::FREE)]);
    Some(Picture::painted(None, pixels, legend))
}

/// Returns the first lines of a file if it is text.
fn head(file: &mut impl Read) -> Vec<String> {
    let mut bytes = Vec::new();
    // What cannot be read is not shown.
    let _ = file.take(HEAD).read_to_end(&mut bytes);
    let whole = std::str::from_utf8(&bytes).ok().or_else(|| {
        // A character may be cut at the end.
        let error = std::str::from_utf8(&bytes).err().filter(|error| error.error_len().is_none())?;
        std::str::from_utf8(&bytes[..error.valid_up_to()]).ok()
    });
    let text = whole.filter(|text| !text.contains(|letter: char| letter.is_control() && !letter.is_whitespace()));
    text.into_iter().flat_map(str::lines).take(MOST_LINES).map(str::to_owned).collect()
}

fn read_table(store: &Store, file: &FileRef) -> Result<AnyTable, ReportError> {
    let damaged = |source| KindError::Decode { kind: "Table", source };
    Ok(read_any(store.read(&file.digest)?).map_err(damaged)?)
}

fn class_scores(scores: &ClassScores) -> Vec<(String, String)> {
    let mut facts = Vec::new();
    if let Some(floor) = &scores.floor {
        facts.extend(Measure::ALL.map(|measure| fact(measure_name(measure), measured(measure, floor.of(measure)))));
        facts.push(fact("doors", floor.doors));
    }
    facts.extend([
        fact("Spearman with visits", figure(scores.spearman_visits)),
        fact("Spearman of the distance to the nearest wall", figure(scores.spearman_wall_distance())),
    ]);
    if scores.auc.is_some() {
        facts.push(fact("AUC", figure(scores.auc)));
        facts.push(fact("AUC of the distance to the nearest wall", figure(scores.auc_wall_distance())));
    }
    if let Some(confusion) = &scores.confusion {
        facts.extend([
            fact("labeled cells", confusion.total()),
            fact("mean recall", figure(confusion.mean_recall())),
            fact("quadratic kappa", figure(confusion.quadratic_kappa())),
            fact("errors that hit an adjacent class", percent(confusion.adjacent_errors())),
        ]);
    }
    facts
}

fn social_costs(costs: &SocialCosts) -> Vec<(String, String)> {
    let mut facts = vec![fact("episodes", costs.predictors.first().map_or(0, |first| first.episodes.len()))];
    for costs in &costs.predictors {
        let within = with_interval(Some(costs.within_quarter), percent);
        let figures = format!(
            "Spearman {}, Kendall {}, within 25 % of the right rank {within}, by chance {}",
            with_interval(costs.spearman, figure),
            with_interval(costs.kendall, figure),
            percent(Some(costs.chance)),
        );
        facts.push(fact(costs.predictor.name(), figures));
        let name = |what: &str| format!("{}, {what}", costs.predictor.name());
        facts.extend(costs.ahead.map(|ahead| (name("Spearman ahead of constant"), with_interval(Some(ahead), figure))));
        facts.extend(costs.size.map(|size| (name("true / expected cost"), with_interval(Some(size.slope), figure))));
        facts.extend(costs.size.map(|size| (name("error of its size"), with_interval(Some(size.error), percent))));
    }
    facts
}

fn path_trials(placed: &Placed<Trials>) -> Vec<(String, String)> {
    let trials = &placed.value.trials;
    let last = trials.last().map_or((0, 0), |trial| (trial.pair + 1, trial.episode + 1));
    let mut facts = place(&placed.frame);
    facts.push(fact("pairs of places", format!("{}, {} trips on each path", last.0, last.1)));
    let all = savings(&placed.value, false);
    let worth = savings(&placed.value, true);
    if let Some(shortest) = all.first() {
        let [seconds, waiting, closest, close, _] = shortest.means;
        let told = format!(
            "{seconds:.1} s to arrive, {waiting:.1} s of waiting, {closest:.2} m at the closest, {} of the time within 0.5 m",
            percent(Some(close))
        );
        facts.push(fact("shortest paths", told));
    }
    let around = worth.first().map_or(0, |worth| worth.pairs);
    facts.push(fact("a way around people", format!("between {around} of {} pairs", last.0)));
    for (which, savings) in [("all pairs", &all), ("a way around", &worth)] {
        for saving in savings.iter().filter(|saving| saving.chooser != Chooser::Shortest && saving.pairs > 0) {
            let [seconds, waiting, closest, close, _] = saving.means;
            let told = format!(
                "saves {} of the social cost, {} longer, {seconds:.1} s to arrive, {waiting:.1} s of waiting, {closest:.2} m at \
                 the closest, {} of the time within 0.5 m",
                with_interval(Some(saving.cost), percent),
                with_interval(Some(saving.longer), percent),
                percent(Some(close)),
            );
            facts.push((format!("{}, {which}", saving.chooser.name()), told));
        }
    }
    facts
}

fn place(frame: &Frame) -> Vec<(String, String)> {
    let (width, height) = (frame.cols as f64 * frame.resolution, frame.rows as f64 * frame.resolution);
    let turned = if frame.yaw == 0.0 { String::new() } else { format!(", turned by {:.1}°", frame.yaw.to_degrees()) };
    vec![
        fact(
            "size",
            format!("{width:.1} × {height:.1} m, {} × {} cells of {} m", frame.cols, frame.rows, frame.resolution),
        ),
        fact("origin", format!("({:.2}, {:.2}) m{turned}", frame.origin.x, frame.origin.y)),
    ]
}

fn class_facts(counts: &ClassCounts) -> Vec<(String, String)> {
    let labeled: u64 = counts.classes.iter().sum();
    let cells = counts.unlabeled + counts.obstacle + labeled;
    let part = |count: u64, whole: u64| format!("{count} ({:.1} %)", 100.0 * count as f64 / whole.max(1) as f64);
    let mut facts = vec![fact("labeled cells", part(labeled, cells))];
    facts.extend(
        (1..).zip(&counts.classes).map(|(class, count)| fact(&format!("class {class}"), part(*count, labeled))),
    );
    facts
}

fn fact(name: &str, value: impl ToString) -> (String, String) {
    (name.to_owned(), value.to_string())
}

fn share(part: usize, whole: usize) -> String {
    format!("{:.1} %", 100.0 * part as f64 / whole.max(1) as f64)
}

fn range(values: impl Iterator<Item = usize> + Clone) -> String {
    let (least, most) = (values.clone().min().unwrap_or(0), values.max().unwrap_or(0));
    if least == most { least.to_string() } else { format!("{least} to {most}") }
}
