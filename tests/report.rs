//! Renders the report of a run from artifacts made on the spot, and looks at it: with a parser's eye, and with a browser's.

use std::path::Path;

use tempfile::TempDir;
use trodden::domain::crowd::{CrowdConfig, NavConfig, Scene, Summary};
use trodden::domain::geometry::Grid;
use trodden::domain::homes::{HomeConfig, generate};
use trodden::domain::map::OccupancyMap;
use trodden::domain::quantize::{Labels, OBSTACLE, QuantizeConfig, quantize};
use trodden::domain::raster::{RasterConfig, VisitCounts, rasterize};
use trodden::domain::score::{Scored, score};
use trodden::domain::social::{CostConfig, Draws, Guess, Predictor, Reading, social_costs};
use trodden::domain::tiles::{Known, LabeledMap, TileConfig, cut};
use trodden::domain::tracks::{Sample, Tracks};
use trodden::domain::unet::{Architecture, Array, Arrays, EpochMetrics, Fit, TrainState};
use trodden::kinds::{
    Checkpoint, CheckpointConfig, Heat, Kind, Learned, NavEpisodes, NavSample, Placed, TrackWriter, Written,
    chunk_files,
};
use trodden::report::picture::{Scale, Shown};
use trodden::report::{html, png, table, terminal};
use trodden::store::{Artifact, Outcome, Role, Run, RunNode, RunStatus, Store};

use super::browser::Page;

/// A run in the making, over artifacts of a temporary store.
struct Maker {
    _folder: TempDir,
    store: Store,
    run: Run,
}

/// Everything of one map that later nodes read.
struct OnMap {
    name: String,
    map: OccupancyMap,
    visits: VisitCounts,
    labels: Labels,
}

impl Maker {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("creates");
        let store = Store::open(folder.path()).expect("opens");
        let run = Run {
            id: "20260102-000000-homes".to_owned(),
            pipeline: "homes".to_owned(),
            file: "pipelines/homes.yaml".to_owned(),
            source: "seed: 2023\nstages: { walks: { use: simulate } } # <script>alert(1)</script>\n".to_owned(),
            started: "2026-01-02T00:00:00Z".to_owned(),
            wall_s: 75.3,
            status: RunStatus::Finished,
            version: "0.1.0".to_owned(),
            ..Run::default()
        };
        Self { _folder: folder, store, run }
    }

    fn put<K: Kind>(&self, value: &K) -> Artifact {
        match value.write(&self.store).expect("the value can be stored") {
            Written::File(file) => Artifact::single(file),
            Written::Bundle(files) => self.store.bundle(K::NAME, K::FORMAT, files).expect("the store takes it"),
        }
    }

    fn node(&mut self, node: &str, role: Role, stage: &str, kind: &str, artifact: Artifact, inputs: &[&str]) {
        self.run.nodes.push(RunNode {
            node: node.into(),
            role,
            stage: stage.to_owned(),
            kind: kind.to_owned(),
            outcome: if kind == "OccupancyMap" { Outcome::Hit } else { Outcome::Ran },
            key: None,
            artifact: Some(artifact),
            wall_s: 0.125,
            amount: None,
            pulled: None,
            absent: false,
            inputs: inputs.iter().map(|input| (*input).to_owned()).collect(),
            error: None,
        });
    }

    /// Adds a value as a node of its own.
    fn add<K: Kind>(&mut self, node: &str, stage: &str, value: &K, inputs: &[&str]) {
        let artifact = self.put(value);
        self.node(node, Role::Node, stage, K::NAME, artifact, inputs);
    }

    /// Generates a home, and people who walk in it, in two chunks.
    fn walked(&mut self, name: &str, number: u64) -> OnMap {
        let map = generate(2023, number, &HomeConfig { area: Some([60.0, 75.0]), ..HomeConfig::default() });
        let of = |stage: &str| format!("{stage}/{name}");
        self.add(&of("maps"), "generate-map", &map, &[]);
        let scene = Scene::new(&map, &CrowdConfig { duration: 20.0, ..CrowdConfig::default() }).expect("there is room");
        let mut samples = Vec::new();
        let mut chunks = Vec::new();
        for chunk in 0..2 {
            let episodes: Vec<_> = (4 * chunk..4 * chunk + 4).map(|n| scene.episode(7, &[1; 32], n)).collect();
            let part: Vec<Sample> = episodes.iter().flat_map(|episode| episode.samples.clone()).collect();
            let mut summary = Summary::default();
            episodes.iter().for_each(|episode| summary += episode.summary);
            let sink = self.store.create().expect("the store takes it");
            let mut writer = TrackWriter::new(sink, *map.frame(), 10.0, 0.2).expect("starts");
            writer.extend(&part).expect("ordered samples");
            writer.note("summary", &serde_json::to_string(&summary).expect("a summary is JSON"));
            let file = writer.finish().expect("ends").finish("").expect("the store takes it");
            let artifact = Artifact::single(file);
            chunks.push(artifact.clone());
            let chunk = format!("{}/chunk-{chunk:02}", of("walks"));
            self.node(&chunk, Role::Chunk, "simulate", "Trajectories", artifact, &[&of("maps")]);
            samples.extend(part);
        }
        let bundle = self
            .store
            .bundle("Trajectories", Placed::<Tracks>::FORMAT, chunk_files(&chunks).expect("single files"))
            .expect("stores");
        let parts = [format!("{}/chunk-00", of("walks")), format!("{}/chunk-01", of("walks"))];
        let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
        self.node(&of("walks"), Role::Node, "simulate", "Trajectories", bundle, &parts);
        let visits = rasterize(&map, &samples, &RasterConfig::default().sweep(10.0, 0.2)).expect("counts");
        let labels = quantize(&map, &visits, &QuantizeConfig::default()).expect("bins");
        let frame = *map.frame();
        self.add(&of("visits"), "rasterize", &Placed::new(frame, visits.clone()), &[&of("maps"), &of("walks")]);
        self.add(&of("labels"), "quantize", &Placed::new(frame, labels.clone()), &[&of("maps"), &of("visits")]);
        OnMap { name: name.to_owned(), map, visits, labels }
    }

    /// Adds windows of a map and a training on them.
    fn trained(&mut self, on: &OnMap) {
        let labeled = [LabeledMap { name: &on.name, map: &on.map, known: Known::Classes(&on.labels) }];
        let tiles = cut(&labeled, &TileConfig { size: 32, stride: 16, ..TileConfig::default() }).expect("cuts");
        let read = [format!("maps/{}", on.name), format!("labels/{}", on.name)];
        self.add("tiles", "tile", &tiles, &[&read[0], &read[1]]);
        let array = |values: usize| Array { shape: vec![values], values: vec![0.5; values] };
        let metrics = |epoch: u32| EpochMetrics {
            epoch,
            loss: 1.2 / f64::from(epoch),
            fit: Fit::Classes {
                accuracy: 1.0 - 0.4 / f64::from(epoch),
                mean_recall: 1.0 - 0.6 / f64::from(epoch),
                recall: vec![0.99, 0.8, 1.0 - 0.7 / f64::from(epoch), 0.6],
            },
            validation: None,
            samples: tiles.samples() as u64,
        };
        for epoch in 1..=4 {
            let config = CheckpointConfig {
                network: Architecture::paper(),
                window: 32,
                batch: 32,
                learning_rate: 0.001,
                learned: Learned::Classes(tiles.target.class_counts().expect("classes")),
                besides: Vec::new(),
            };
            let model = Arrays::from([("head.weight".to_owned(), array(12))]);
            let state = TrainState { epoch, model: model.clone(), optimizer: model };
            let checkpoint = Checkpoint { config, state, metrics: (1..=epoch).map(metrics).collect() };
            let artifact = self.put(&checkpoint);
            let (name, before) = (format!("model/epoch-{epoch:02}"), format!("model/epoch-{:02}", epoch - 1));
            let inputs: &[&str] = if epoch == 1 { &["tiles"] } else { &["tiles", &before] };
            self.node(&name, Role::Step, "train", "Checkpoint", artifact.clone(), inputs);
            if epoch == 4 {
                self.node("model", Role::Node, "train", "Checkpoint", artifact, &["model/epoch-04"]);
            }
        }
    }

    /// Adds a prediction, its scores and costs; `reach` is how far it is smeared, in cells.
    fn predicted(&mut self, on: &OnMap, stage: &str, reach: isize) {
        let frame = *on.map.frame();
        let heat = smeared(on, reach);
        let classes = Grid::from_fn(frame.rows, frame.cols, |cell| match heat[cell] {
            _ if !on.map.free()[cell] => OBSTACLE,
            value if value > 0.5 => 3,
            value if value > 0.2 => 2,
            _ => 1,
        });
        let probabilities =
            (0..4i8).map(|class| classes.map(|found| if *found == class { 1.0 } else { 0.0 })).collect();
        let (map, own) = (format!("maps/{}", on.name), format!("{stage}/{}", on.name));
        let value = Heat::of_classes(heat.clone(), classes.clone(), probabilities);
        self.add(&own, "annotate", &Placed::new(frame, value), &[&map, "model"]);
        let scored = Scored {
            free: on.map.free(),
            heat: &heat,
            density: None,
            flow: None,
            predicted: Some(&classes),
            labels: Some(&on.labels),
            visits: Some(&on.visits),
            weights: Some(&[0.1, 0.2, 0.3, 0.4]),
        };
        let scores = score(&scored, frame.resolution, &[4; 32]).expect("scores");
        let read = [format!("labels/{}", on.name), format!("visits/{}", on.name)];
        self.add(&format!("scores-{stage}/{}", on.name), "score", &scores, &[&own, &read[0], &read[1]]);
        if reach == 2 {
            self.crossed(on, &own, &heat);
        }
    }

    /// Adds robots among pedestrians and their costs.
    fn crossed(&mut self, on: &OnMap, heat_node: &str, heat: &Grid<f32>) {
        let crowd = CrowdConfig { agents: [5, 6], ..CrowdConfig::default() };
        let scene = Scene::new(&on.map, &crowd).expect("there is room");
        let nav = NavConfig { steps: 40, ..NavConfig::default() };
        let mut samples = Vec::new();
        for number in 0..12 {
            let episode = scene.navigation_episode(3, &[2; 32], number, &nav).expect("long enough");
            let robot = episode.robot;
            samples.extend(episode.samples.into_iter().map(|sample| NavSample { sample, robot: sample.id == robot }));
        }
        let trips = NavEpisodes { frame_rate: 10.0, samples, summary: None };
        let (frame, draws) = (on.map.frame(), Draws { seed: 1, input: &[3; 32] });
        let constant = on.map.free().map(|free| if *free { 1.0 } else { 0.0 });
        let guess = |predictor, heat| Guess { predictor, heat, reading: Reading::Probability };
        let heats = [guess(Predictor::Model, heat), guess(Predictor::Constant, &constant)];
        let costs = social_costs(&trips.steps(), &heats, frame, &CostConfig::default(), &draws).expect("costs");
        let (map, own) = (format!("maps/{}", on.name), format!("trips/{}", on.name));
        self.add(&own, "navigate", &Placed::new(*frame, trips), &[&map]);
        self.add(&format!("costs/{}", on.name), "cost", &costs, &[&own, heat_node]);
    }
}

/// Visits as heat: averaged over the cells within reach, divided by the largest.
fn smeared(on: &OnMap, reach: isize) -> Grid<f32> {
    let counts = &on.visits.counts;
    let mean = Grid::from_fn(counts.rows(), counts.cols(), |cell| {
        if !on.map.free()[cell] {
            return 0.0;
        }
        let near = (-reach..=reach).flat_map(|dr| (-reach..=reach).map(move |dc| (dr, dc)));
        let sum: u32 = near.filter_map(|(dr, dc)| counts.get(cell.row as isize + dr, cell.col as isize + dc)).sum();
        sum as f32 + 0.5
    });
    let most = mean.as_slice().iter().copied().fold(0.0, f32::max);
    mean.map(|value| value / most)
}

/// A finished run: one home to learn from, one to predict for, two ways of annotating.
fn finished() -> Maker {
    let mut maker = Maker::new();
    let train = maker.walked("home_00", 0);
    let test = maker.walked("home_1000", 1000);
    maker.trained(&train);
    maker.predicted(&test, "heat", 2);
    maker.predicted(&test, "heat-wide", 6);
    maker
}

/// Everything that a page could load from elsewhere.
fn check_offline(page: &str) {
    for (at, _) in page.match_indices("<script") {
        let inline = ["<script>(() =>", "<script type=\"application/json\">", "<script type=\"text/plain\">"];
        assert!(inline.iter().any(|begin| page[at..].starts_with(begin)), "{}", &page[at..at + 60]);
    }
    for outside in ["<link", "<iframe", "@import", "src=", "http-equiv", "url(http"] {
        assert!(!page.contains(outside), "the page has `{outside}`");
    }
    for (at, _) in page.match_indices("href=\"") {
        let target = &page[at + 6..(at + 40).min(page.len())];
        assert!(target.starts_with('#') || target.starts_with("data:image/png;base64,"), "{target}");
    }
    assert!(!page.contains("http://") && !page.contains("https://"), "the page names an address");
}

fn element_count(page: &str, name: &str) -> (usize, usize) {
    (
        page.matches(&format!("<{name}>")).count() + page.matches(&format!("<{name} ")).count(),
        page.matches(&format!("</{name}>")).count(),
    )
}

#[test]
fn the_report_shows_a_finished_run() {
    let maker = finished();
    let path = html::write(&maker.store, &maker.run).expect("writes");
    let page = std::fs::read_to_string(&path).expect("reads");
    check_offline(&page);
    for element in ["section", "figure", "svg", "table", "tr", "td", "details", "div", "ul", "li"] {
        let (opened, closed) = element_count(&page, element);
        assert_eq!(opened, closed, "<{element}>");
    }
    assert!(page.contains("&lt;script&gt;alert(1)") && !page.contains("class=\"missing\""));
    // One map, two visits, labels and trips; three views of either heat; the other map's labels; the windows.
    assert_eq!(page.matches("data:image/png").count(), 5 + 6 + 1 + 1);
    assert_eq!(page.matches("aria-label=\"confusion matrix").count(), 6);
    for expected in [
        "AUC of the wall distance",
        "All predictions side by side",
        "Predictions against visits, by map",
        "heat-wide",
        "ρ of the wall distance",
        "Stuck paths",
        "Loss (eq. 4)",
        "home_1000",
        "trodden run pipelines/homes.yaml",
    ] {
        assert!(page.contains(expected), "{expected}");
    }
    // A row and a box for each heat that costs are predicted from, with intervals.
    for predictor in ["model", "constant"] {
        assert_eq!(page.matches(&format!("<td>{predictor}</td>")).count(), 1, "{predictor}");
        assert_eq!(page.matches(&format!("home_1000, {predictor}</text>")).count(), 1, "{predictor}");
    }
    assert!(page.contains("% ["), "an interval");
    // Drawn once: the second time everything comes from the cache, and is the same.
    let (first, again) = (page, html::render(&maker.store, &maker.run));
    assert!(first == again);
    std::fs::remove_dir_all(maker.store.root().join("cache")).expect("the cache is there");
    assert!(first == html::render(&maker.store, &maker.run));
    check_in_browser(&path);
    // A page for one of the heats has it first.
    let wide = maker.run.nodes.iter().find(|node| node.node == "heat-wide/home_1000").expect("a node");
    let page = html::view(&maker.store, &maker.run, wide).expect("reads").expect("it lies on a map");
    let at = |name: &str| page.find(&format!("\"name\":\"{name}\"")).expect("a layer");
    assert!(at("heat, heat-wide") < at("heat, heat") && at("heat, heat") < at("visits"));
}

#[test]
fn the_report_of_a_failed_run_says_what_is_missing() {
    let mut maker = finished();
    let maker = &mut maker;
    maker.run.status = RunStatus::Failed;
    maker.run.warnings.push("`walks/home_00`: odd".to_owned());
    for node in &mut maker.run.nodes {
        if node.node == "model" || node.node == "heat/home_1000" {
            node.artifact = None;
            node.outcome = if node.node == "model" { Outcome::Failed } else { Outcome::Skipped };
            node.error = (node.node == "model").then(|| "the loss is `NaN`".to_owned());
        }
    }
    // An object that is gone, too.
    let labels = maker.run.nodes.iter().find(|node| node.node == "labels/home_00").expect("a node");
    let digest = labels.artifact.as_ref().expect("an artifact").digest;
    std::fs::remove_file(maker.store.path_of(&digest)).expect("removes");
    let page = html::render(&maker.store, &maker.run);
    check_offline(&page);
    for expected in [
        "the loss is `NaN`",
        "heat/home_1000 was not made",
        "labels/home_00 cannot be shown",
        "4 epochs",
        "1 skipped",
        "odd",
    ] {
        assert!(page.contains(expected), "{expected}");
    }
}

#[test]
fn runs_of_nothing_have_a_report() {
    let mut maker = Maker::new();
    maker.run.status = RunStatus::Interrupted;
    let page = html::render(&maker.store, &maker.run);
    check_offline(&page);
    assert!(page.contains("interrupted") && !page.contains("NaN"));
}

#[test]
fn every_kind_is_shown_in_a_terminal_and_as_a_picture() {
    let maker = finished();
    let (mut pictures, mut tables) = (Vec::new(), Vec::new());
    for node in maker.run.nodes.iter().filter(|node| node.role == Role::Node) {
        let artifact = node.artifact.as_ref().expect("an artifact");
        let shown = Shown::of(&maker.store, &node.kind, artifact).expect("is shown");
        assert!(!shown.facts().is_empty(), "{}", node.node);
        if let Some(picture) = shown.picture() {
            pictures.push(node.kind.clone());
            for color in [false, true] {
                let text = terminal::raster(picture, Scale::Log, 60, color);
                assert!(text.lines().count() > 5 && text.contains('\x1b') == color, "{}", node.node);
            }
            let figure = png::figure(picture, Scale::Linear, &node.node);
            assert!(image::load_from_memory(&figure).expect("decodes").width() > 100);
        }
        if let Some(shown) = shown.table() {
            tables.push(node.kind.clone());
            assert!(table::text(shown, 3).lines().count() > 3);
            assert_eq!(table::json_rows(shown).count(), shown.rows());
        }
    }
    for kinds in [&mut pictures, &mut tables] {
        kinds.sort();
        kinds.dedup();
    }
    assert_eq!(pictures, ["Heat", "Labels", "NavEpisodes", "OccupancyMap", "Tiles", "Trajectories", "VisitCounts"]);
    assert_eq!(tables, ["Checkpoint", "ClassScores", "SocialCosts"]);
    let artifact = maker.run.nodes[0].artifact.as_ref().expect("an artifact");
    // Of a kind that nobody knows the table is shown that it is.
    let shown = Shown::of(&maker.store, "Pottery", artifact).expect("is a table");
    assert!(shown.picture().is_none() && shown.table().is_some_and(|table| table.rows() > 1000));
}

/// Counts the images and those that decode, opens all views, and counts those that show something.
const PROBE: &str = "(async () => {
    const images = [...document.querySelectorAll('image')].map(image => {
        const probe = new Image();
        probe.src = image.getAttribute('href');
        return probe.decode().then(() => probe.naturalWidth > 0, () => false);
    });
    const decoded = (await Promise.all(images)).filter(Boolean).length;
    const views = [...document.querySelectorAll('.trodden-view')];
    const lazy = views.every(view => !view.querySelector('canvas'));
    document.querySelectorAll('details.look').forEach(fold => { fold.open = true; });
    await until(() => views.every(view => 'ready' in view.dataset));
    const layers = views.map(view => [...view.querySelectorAll('.tv-choice')].map(label => label.textContent));
    return { images: images.length, decoded, lazy, layers };
})()";

/// Loads the page in a browser without a window, where one is installed.
fn check_in_browser(path: &Path) {
    let page = std::fs::read_to_string(path).expect("reads");
    let Some(mut open) = Page::open(path, "") else { return };
    let said = open.run(PROBE);
    open.check();
    let images = page.matches("<image ").count();
    let layers = [
        "heat, heat",
        "heat, heat-wide",
        "classes, heat",
        "classes, heat-wide",
        "visits",
        "labels",
        "map only",
        "linear",
        "log",
        "people of the episode",
        "tracks of the episode",
        "grid in meters",
    ];
    let mut told: Vec<&str> = said["layers"][0].as_array().expect("labels").iter().filter_map(|l| l.as_str()).collect();
    told.sort_unstable_by_key(|label| layers.iter().position(|layer| layer == label));
    assert_eq!(told, layers);
    assert_eq!((&said["images"], &said["decoded"], &said["lazy"]), (&images.into(), &images.into(), &true.into()));
}
