use super::*;

/// One row of cells; those without a value are walls.
fn row<T: Copy>(values: &[T]) -> Grid<T> {
    Grid::from_vec(1, values.len(), values.to_vec())
}

fn free(count: usize) -> Grid<bool> {
    Grid::filled(1, count, true)
}

fn known(heat: &[f32], density: &[f32]) -> Known {
    Known { heat: row(heat), density: Some(row(density)), flow: None }
}

fn seen(visits: &Grid<u32>) -> Seen<'_> {
    Seen { visits, flow: None, steps: None, watched: None }
}

fn config(prior: f64, spread: f64) -> UpdateConfig {
    UpdateConfig { prior, spread }
}

fn close(found: &Grid<f32>, expected: &[f64]) {
    for (found, expected) in found.as_slice().iter().zip(expected) {
        assert!((f64::from(*found) - expected).abs() < 1e-6, "{found} {expected}");
    }
}

#[test]
fn without_visits_nothing_changes() {
    let flow = std::array::from_fn(|direction| row(&[if direction == 2 { 1.0f32 } else { 0.0 }; 4]));
    let prior = Known { flow: Some(flow), ..known(&[0.75, 0.0, 0.25, 0.5], &[1.5, 0.25, 1.25, 1.0]) };
    let after = update(&free(4), 0.1, &prior, &seen(&row(&[0; 4])), &UpdateConfig::default());
    assert_eq!(after, prior);
    // A floor of which nothing is predicted, and of which nothing is seen, is all alike.
    let nothing = Known { heat: row(&[0.0; 2]), density: None, flow: None };
    let after = update(&free(2), 0.1, &nothing, &seen(&row(&[0; 2])), &UpdateConfig::default());
    assert_eq!(after, nothing);
}

/// Half and one and a half visits of the mean cell are expected, six and two are seen: 8 on 2 cells, so A is 4.
#[test]
fn expectation_and_visits_are_added() {
    let (prior, visits) = (known(&[0.0, 0.5], &[0.5, 1.5]), row(&[6, 2]));
    // (4 · 0.5 + 6) / (4 + 4) and (4 · 1.5 + 2) / (4 + 4).
    let after = update(&free(2), 0.1, &prior, &seen(&visits), &config(4.0, 0.0));
    assert_eq!((after.heat, after.density), (row(&[0.0, 0.0]), Some(row(&[1.0, 1.0]))));
    // (2 · 0.5 + 6) / 6 and (2 · 1.5 + 2) / 6.
    let after = update(&free(2), 0.1, &prior, &seen(&visits), &config(2.0, 0.0));
    assert_eq!(after.heat, row(&[0.5, 0.0]));
    close(&after.density.expect("a density"), &[7.0 / 6.0, 5.0 / 6.0]);
}

#[test]
fn many_visits_prevail() {
    let (prior, visits) = (known(&[0.0, 0.5], &[0.5, 1.5]), row(&[600_000, 200_000]));
    let after = update(&free(2), 0.1, &prior, &seen(&visits), &config(2.0, 0.3));
    // They do not even reach for their neighbors.
    let density = after.density.expect("a density");
    assert!((density.as_slice()[0] - 1.5).abs() < 1e-4, "{density:?}");
}

#[test]
fn what_nobody_looked_at_stays() {
    let (prior, visits, watched) = (known(&[0.0, 0.5, 0.25], &[0.5, 1.5, 1.0]), row(&[8, 2, 4]), row(&[2, 0, 1]));
    let seen = Seen { watched: Some(&watched), ..seen(&visits) };
    let after = update(&free(3), 0.1, &prior, &seen, &config(2.0, 0.0));
    // Looked all the time, never, half of it: A = 12 / (0.5 + 1.0 / 2) = 12. So (1 + 8) / (2 + 12), 3 / 2, (2 + 4) / (2 + 6).
    let rates = [9.0 / 14.0, 1.5, 0.75];
    let mean = rates.iter().sum::<f64>() / 3.0;
    close(&after.density.expect("a density"), &rates.map(|rate| rate / mean));
    close(&after.heat, &[0.0, 2.0 / 3.0, 1.0 / 3.0]);
}

/// As much time as there were visits: 2 a cell.
#[test]
fn time_has_a_density_of_its_own() {
    let (prior, visits, steps) = (known(&[0.0, 0.5], &[1.0, 1.0]), row(&[2, 2]), row(&[30, 10]));
    let seen = Seen { steps: Some(&steps), ..seen(&visits) };
    let after = update(&free(2), 0.1, &prior, &seen, &config(2.0, 0.0));
    // (2 + 3) / 4 and (2 + 1) / 4.
    close(&after.density.expect("a density"), &[1.25, 0.75]);
    // Without a density of its own the prediction gets none of visits alone.
    let bare = Known { density: None, ..prior };
    let without = Seen { steps: None, ..seen };
    assert_eq!(update(&free(2), 0.1, &bare, &without, &config(2.0, 0.0)).density, None);
}

#[test]
fn directions_are_counted_beside_what_was_expected() {
    let ahead = |value: f32| -> [Grid<f32>; DIRECTIONS] {
        std::array::from_fn(|direction| row(&[if direction == 0 { value } else { 0.0 }; 2]))
    };
    let back: [Grid<u32>; DIRECTIONS] =
        std::array::from_fn(|direction| if direction == 4 { row(&[2, 0]) } else { row(&[0, 0]) });
    let visits = row(&[2, 2]);
    let seen = Seen { flow: Some(&back), ..seen(&visits) };
    let of = |flow| {
        let prior = Known { flow, ..known(&[0.0, 0.0], &[1.0, 1.0]) };
        update(&free(2), 0.1, &prior, &seen, &config(2.0, 0.0)).flow.expect("a flow")
    };
    // 2 · 1 passages ahead were expected, 2 back were seen; the other cell has only what was expected.
    let flow = of(Some(ahead(1.0)));
    assert_eq!((&flow[0], &flow[4]), (&row(&[0.5, 1.0]), &row(&[0.5, 0.0])));
    let flow = of(None);
    assert_eq!((&flow[0], &flow[4]), (&row(&[0.0, 0.0]), &row(&[1.0, 0.0])));
}

#[test]
fn visits_spread_but_never_through_walls() {
    let free = row(&[true, true, true, false, true]);
    let one = row(&[0.0, 1.0, 0.0, 0.0, 0.0]);
    assert_eq!(spread(&one, &free, 0), one);
    close(&spread(&one, &free, 1).map(|value| *value as f32), &[0.2, 0.6, 0.2, 0.0, 0.0]);
    close(&spread(&one, &free, 2).map(|value| *value as f32), &[0.28, 0.44, 0.28, 0.0, 0.0]);
    let wide = spread(&one, &free, 500);
    close(&wide.map(|value| *value as f32), &[1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0, 0.0, 0.0]);
    let square =
        spread(&Grid::from_fn(3, 3, |c| f64::from(u8::from(c.row == 1 && c.col == 1))), &Grid::filled(3, 3, true), 1);
    assert_eq!(square.as_slice(), [0.0, 0.2, 0.0, 0.2, 1.0 - 4.0 * 0.2, 0.2, 0.0, 0.2, 0.0]);
}

/// k steps of a fifth have a variance of 2k/5: three make a width of 1.1 cells. At 64 visits the width is half, at a 64th of
/// one twice, and at fewer no more than that.
#[test]
fn the_width_falls_with_the_number_of_visits() {
    let width = libm::sqrt(1.2);
    assert_eq!([64.0, 1.0, 1.0 / 64.0, 0.0].map(|visits| spreading(width, visits)), [1, 3, 12, 12]);
    assert_eq!(spreading(3.0, 1e12), 0);
    assert_eq!(spreading(0.0, 0.0), 0);
}

/// Cells have the densities of their ranks: what is hottest has the highest, whatever its own was.
#[test]
fn rates_have_the_order_of_the_heat() {
    let found = rates(&row(&[0.5, 0.0, 0.25]), &row(&[1.0, 2.0, 0.0]), &free(3));
    assert_eq!(found, row(&[2.0, 0.0, 1.0]));
    let found = rates(&row(&[0.5, 0.0, 0.0]), &row(&[2.0, 0.0, 1.0]), &free(3));
    assert_eq!(found, row(&[2.0, 0.5, 0.5]));
    let walls = rates(&row(&[0.5, 0.0, 0.25]), &row(&[1.0, 9.0, 3.0]), &row(&[true, false, true]));
    assert_eq!(walls, row(&[1.5, 0.0, 0.5]));
}

#[test]
fn settings_are_checked() {
    let check = |prior, spread| config(prior, spread).check().map_err(|error| error.to_string());
    assert_eq!(check(0.5, 0.0), Ok(()));
    assert_eq!(check(0.0, 0.1), Err("`prior` is `0`, allowed is above 0 and up to 1000".to_owned()));
    assert_eq!(check(1.0, f64::NAN), Err("`spread` is `NaN`, allowed is 0 to 5 m".to_owned()));
}
