//! The crowd layer: the oracle's scenes in which plain ORCA is stuck, and statistics over episodes on maps.

use std::path::PathBuf;

use rayon::prelude::*;
use trodden::domain::crowd::{Crowd, CrowdConfig, NavConfig, Robot, Scene, Speed, Status, Summary};
use trodden::domain::geometry::{Frame, Grid, Point};
use trodden::domain::map::OccupancyMap;
use trodden::domain::random::Stream;
use trodden::domain::tracks::Sample;

/// Finds the oracle's folder, or says that it is not there.
fn oracle() -> Option<PathBuf> {
    let shared = std::env::var_os("TRODDEN_SHARED")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared")), PathBuf::from);
    let folder = std::env::var_os("TRODDEN_ORACLE").map_or_else(|| shared.join("oracle/orca"), PathBuf::from);
    if !folder.is_dir() {
        println!("skipped: no oracle at {}", folder.display());
        return None;
    }
    Some(folder)
}

/// One of the oracle's scenes.
struct OracleScene {
    polygons: Vec<Vec<Point>>,
    starts: Vec<Point>,
    goals: Vec<Point>,
    config: CrowdConfig,
    speed: f64,
}

fn read_scene(folder: &std::path::Path, name: &str) -> OracleScene {
    let read = |kind: &str| std::fs::read_to_string(folder.join(format!("{name}.{kind}.csv"))).expect("a scene's file");
    let mut polygons: Vec<Vec<Point>> = Vec::new();
    for line in read("obst").lines().skip(1) {
        let fields: Vec<f64> = line.split(',').map(|field| field.parse().expect("a number")).collect();
        if fields[0] as usize == polygons.len() {
            polygons.push(Vec::new());
        }
        polygons[fields[0] as usize].push(Point::new(fields[2], fields[3]));
    }
    let (mut starts, mut goals) = (Vec::new(), Vec::new());
    let mut numbers = Vec::new();
    for line in read("agents").lines().skip(1) {
        let parts: Vec<&str> = line.split('"').collect();
        let start: Vec<f64> = parts[0].split(',').filter_map(|field| field.parse().ok()).collect();
        let goal = parts[1].split(';').next_back().expect("a goal");
        let goal: Vec<f64> = goal.split(' ').map(|field| field.parse().expect("a number")).collect();
        numbers = parts[2].split(',').filter_map(|field| field.parse().ok()).collect::<Vec<f64>>();
        starts.push(Point::new(start[1], start[2]));
        goals.push(Point::new(goal[0], goal[1]));
    }
    let [time_step, neighbor_distance, most, horizon, obstacle_horizon, radius, max_speed, speed] = numbers[..] else {
        panic!("{name} has {} numbers", numbers.len())
    };
    let config = CrowdConfig {
        agents: [1, 30],
        radius,
        speed: Speed { mean: speed, deviation: 0.0, min: speed, max: speed },
        max_speed_factor: max_speed / speed,
        // The oracle's numbers are float32: 0.100000001 s.
        time_step: (time_step * 1e6).round() / 1e6,
        neighbor_distance,
        max_neighbors: most as usize,
        horizon,
        obstacle_horizon,
        ..CrowdConfig::default()
    };
    OracleScene { polygons, starts, goals, config, speed }
}

/// Lets the crowd of a scene walk and returns who has been at their goal within `seconds`, and the crowd's last word.
fn walk(scene: &OracleScene, seed: u64, seconds: f64) -> (Vec<Option<f64>>, Summary) {
    let points: Vec<Point> = scene.starts.iter().chain(&scene.goals).copied().collect();
    let world = Scene::from_polygons(&scene.polygons, &points, &scene.config).expect("a world");
    let mut crowd = Crowd::new(&world);
    for (agent, start) in scene.starts.iter().enumerate() {
        let noise = Stream::new(seed, &[0; 32], agent as u64, "oracle");
        crowd.add(world.frame().to_local(*start), scene.speed, noise);
    }
    for (agent, goal) in scene.goals.iter().enumerate() {
        assert!(crowd.send(agent, world.frame().to_local(*goal)), "agent {agent} has a way");
    }
    let mut arrivals = vec![None; crowd.len()];
    let steps = (seconds / scene.config.time_step) as usize;
    for step in 0..steps {
        crowd.step();
        for (agent, arrival) in arrivals.iter_mut().enumerate() {
            if arrival.is_none() && crowd.status(agent) == Status::Arrived {
                *arrival = Some(step as f64 * scene.config.time_step);
            }
        }
    }
    (arrivals, crowd.summary())
}

#[test]
fn where_plain_orca_is_stuck_everyone_arrives() {
    let Some(folder) = oracle() else { return };
    let names = [
        ("headon2_exact", 20.0),
        ("headon2_offset", 20.0),
        ("cross4_exact", 20.0),
        ("circle10", 30.0),
        ("doorway1_narrow", 20.0),
        ("doorway2_narrow_conflict", 30.0),
        ("doorway6_oneway", 40.0),
        ("doorway6_twoway", 40.0),
        ("crowd30_dense", 90.0),
        ("lshape_corner", 30.0),
        ("room_cw_corners", 30.0),
    ];
    let mut failures = Vec::new();
    for (name, seconds) in names {
        let scene = read_scene(&folder, name);
        for seed in 0..5 {
            let (arrivals, summary) = walk(&scene, seed, seconds);
            let last = arrivals.iter().copied().map(|arrival| arrival.unwrap_or(f64::INFINITY)).fold(0.0, f64::max);
            println!("{name}, seed {seed}: last arrival {last:.1} s, {summary:?}");
            if arrivals.contains(&None) || summary.wall_hits + summary.blocked_centers > 0 {
                failures.push((name, seed, arrivals));
            }
        }
    }
    assert!(failures.is_empty(), "{failures:?}");
}
