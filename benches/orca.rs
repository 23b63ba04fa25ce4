//! Measures one ORCA step on one thread, in agent-steps per second.
//!
//! `cargo bench --bench orca`. The scenes:
//! - `circle250`: 250 agents on a circle of 200 m, each bound for the opposite side (RVO2's `Circle` example), at three
//!   moments: apart, closing in, packed in the middle;
//! - `blocks100`: four crowds of 25 and four blocks between them (RVO2's `Blocks` example), likewise;
//! - `flat88`: a furnished flat of 12 x 10 m, 22 rectangles, 15 agents, for obstacle horizons of 2, 1 and 0.5 s.
//!
//! A sample sets the state of the scene at that moment and steps from there, so that all samples do the same work.

use std::sync::Arc;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use trodden::domain::geometry::Point;
use trodden::domain::orca::{AgentParameters, Obstacles, Simulation};
use trodden::domain::random::Stream;

/// Steps of one sample.
const STEPS: usize = 20;

/// A simulation whose agents head straight for goals.
#[derive(Clone)]
struct Scene {
    simulation: Simulation,
    goals: Vec<Point>,
    speed: f64,
    /// Where new goals come from on arrival; without it agents stop there.
    resample: Option<Stream>,
}

impl Scene {
    /// Sets all preferred velocities. It is measured along and costs next to nothing.
    fn head_for_goals(&mut self) {
        for (agent, goal) in self.goals.iter_mut().enumerate() {
            let position = self.simulation.position(agent);
            if let Some(stream) = &mut self.resample
                && position.distance(*goal) < 0.3
            {
                *goal = free_point(self.simulation.obstacles(), stream);
            }
            let way = *goal - position;
            let length = way.norm();
            let velocity = if length > self.speed { way * (self.speed / length) } else { way };
            self.simulation.set_preferred_velocity(agent, velocity);
        }
    }

    fn run(&mut self, steps: usize) {
        for _ in 0..steps {
            self.head_for_goals();
            self.simulation.step();
        }
    }
}

fn circle() -> Scene {
    let obstacles = Arc::new(Obstacles::new(&[]).expect("no walls are sound walls"));
    let mut simulation = Simulation::new(0.25, obstacles);
    let parameters = AgentParameters {
        radius: 1.5,
        max_speed: 2.0,
        neighbor_distance: 15.0,
        max_neighbors: 10,
        time_horizon: 10.0,
        obstacle_horizon: 10.0,
    };
    let mut goals = Vec::new();
    for i in 0..250 {
        let angle = f64::from(i) * std::f64::consts::TAU / 250.0;
        let position = Point::new(libm::cos(angle), libm::sin(angle)) * 200.0;
        simulation.add_agent(position, parameters);
        goals.push(-position);
    }
    Scene { simulation, goals, speed: 1.0, resample: None }
}

fn blocks() -> Scene {
    let square = |x: f64, y: f64| {
        let corner = |dx: f64, dy: f64| Point::new(x + dx, y + dy);
        vec![corner(-15.0, -15.0), corner(15.0, -15.0), corner(15.0, 15.0), corner(-15.0, 15.0)]
    };
    let polygons = [square(-25.0, 25.0), square(25.0, 25.0), square(25.0, -25.0), square(-25.0, -25.0)];
    let obstacles = Arc::new(Obstacles::with_reach(&polygons, 12.0).expect("squares are sound walls"));
    let mut simulation = Simulation::new(0.25, obstacles);
    let parameters = AgentParameters {
        radius: 2.0,
        max_speed: 2.0,
        neighbor_distance: 15.0,
        max_neighbors: 10,
        time_horizon: 5.0,
        obstacle_horizon: 5.0,
    };
    let mut goals = Vec::new();
    let mut stream = Stream::new(1, &[0; 32], 0, "blocks");
    for i in 0..5 {
        for j in 0..5 {
            for (sx, sy) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
                let position = Point::new(sx * (55.0 + f64::from(i) * 10.0), sy * (55.0 + f64::from(j) * 10.0));
                // A little off the diagonal, without which everyone would stand still in the middle.
                simulation.add_agent(position, parameters);
                goals.push(Point::new(-sx * 75.0 + stream.between(-1.0, 1.0), -sy * 75.0 + stream.between(-1.0, 1.0)));
            }
        }
    }
    Scene { simulation, goals, speed: 1.0, resample: None }
}

/// The flat: an outer wall of four slabs, inner walls with doors, furniture. Left, bottom, right, top in meters.
#[rustfmt::skip]
const FLAT: [(f64, f64, f64, f64); 22] = [
    // Outer walls.
    (0.0, 0.0, 12.0, 0.2), (0.0, 9.8, 12.0, 10.0), (0.0, 0.2, 0.2, 9.8), (11.8, 0.2, 12.0, 9.8),
    // A corridor across the flat with a room and a door of 0.9 m to each side, four rooms in all.
    (0.2, 4.0, 2.5, 4.1), (3.4, 4.0, 8.6, 4.1), (9.5, 4.0, 11.8, 4.1),
    (0.2, 5.6, 2.5, 5.7), (3.4, 5.6, 8.6, 5.7), (9.5, 5.6, 11.8, 5.7),
    (6.0, 0.2, 6.1, 4.0), (6.0, 5.7, 6.1, 9.8),
    // Furniture: beds, tables, wardrobes, shelves, a sideboard, armchairs.
    (0.2, 0.2, 2.2, 1.8), (3.6, 1.4, 4.8, 2.2), (5.4, 0.2, 6.0, 2.0),
    (6.1, 0.2, 6.7, 2.4), (8.6, 1.2, 10.0, 2.2), (11.2, 0.2, 11.8, 3.0),
    (0.2, 8.0, 2.0, 9.8), (3.4, 7.4, 4.4, 8.4), (6.1, 7.8, 8.1, 9.8), (10.0, 7.2, 11.0, 8.2),
];

fn free_point(obstacles: &Obstacles, stream: &mut Stream) -> Point {
    loop {
        let point = Point::new(stream.between(0.5, 11.5), stream.between(0.5, 9.5));
        let inside = FLAT.iter().any(|(l, b, r, t)| point.x > *l && point.x < *r && point.y > *b && point.y < *t);
        if !inside && obstacles.sees(point, point, 0.25) {
            return point;
        }
    }
}

fn flat(obstacle_horizon: f64) -> Scene {
    let polygons: Vec<Vec<Point>> = FLAT
        .iter()
        .map(|(l, b, r, t)| vec![Point::new(*l, *b), Point::new(*r, *b), Point::new(*r, *t), Point::new(*l, *t)])
        .collect();
    let obstacles = Arc::new(Obstacles::new(&polygons).expect("rectangles are sound walls"));
    let mut stream = Stream::new(2, &[0; 32], 0, "flat");
    let parameters = AgentParameters {
        radius: 0.2,
        max_speed: 2.0,
        neighbor_distance: 5.0,
        max_neighbors: 10,
        time_horizon: 2.0,
        obstacle_horizon,
    };
    let mut simulation = Simulation::new(0.1, Arc::clone(&obstacles));
    let mut goals = Vec::new();
    for _ in 0..15 {
        simulation.add_agent(free_point(&obstacles, &mut stream), parameters);
        goals.push(free_point(&obstacles, &mut stream));
    }
    Scene { simulation, goals, speed: 1.3, resample: Some(stream) }
}

fn measure(criterion: &mut Criterion, name: &str, scene: &Scene) {
    let mut group = criterion.benchmark_group("orca");
    group.throughput(Throughput::Elements((scene.simulation.len() * STEPS) as u64));
    group.bench_function(name, |bencher| {
        bencher.iter_batched_ref(|| scene.clone(), |scene| scene.run(STEPS), BatchSize::SmallInput);
    });
    group.finish();
}

fn scenes(criterion: &mut Criterion) {
    for (name, mut scene, moments) in [("circle250", circle(), [0, 600, 1200]), ("blocks100", blocks(), [0, 200, 400])]
    {
        let mut now = 0;
        for moment in moments {
            scene.run(moment - now);
            now = moment;
            measure(criterion, &format!("{name}/step-{moment}"), &scene);
        }
    }
    for horizon in [2.0, 1.0, 0.5] {
        let mut scene = flat(horizon);
        scene.run(50);
        measure(criterion, &format!("flat88/horizon-{horizon}"), &scene);
    }
}

fn index(criterion: &mut Criterion) {
    let obstacles = Arc::clone(flat(1.0).simulation.obstacles());
    let mut stream = Stream::new(3, &[0; 32], 0, "sight");
    let pairs: Vec<(Point, Point)> =
        (0..1000).map(|_| (free_point(&obstacles, &mut stream), free_point(&obstacles, &mut stream))).collect();
    let mut group = criterion.benchmark_group("walls");
    group.throughput(Throughput::Elements(1000));
    group.bench_function("sees", |bencher| {
        bencher.iter(|| pairs.iter().filter(|(a, b)| obstacles.sees(*a, *b, 0.2)).count());
    });
    group.bench_function("distance", |bencher| {
        bencher.iter(|| pairs.iter().map(|(a, _)| obstacles.distance(*a)).sum::<f64>());
    });
    group.finish();
}

criterion_group!(benches, scenes, index);
criterion_main!(benches);
