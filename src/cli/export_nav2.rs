//! `export nav2`: a heat as masks for the costmap filters of Nav2, with the parameters to paste.

use std::path::{Path, PathBuf};

use super::error::CliError;
use super::out_folder::OutFolder;
use super::screen::Screen;
use crate::domain::geometry::{Frame, Grid};
use crate::domain::map::{MapYaml, free_pixels};
use crate::domain::masks::{self, MOST};
use crate::kinds::{Heat, Placed, SingleFile};
use crate::store::read_bounded;

/// The most bytes of a file that is read.
const MOST_BYTES: u64 = 4 << 30;

/// The masks by name, with the type of their filter: 0 keepout, 1 speed in percent of the most, 4 zones.
const MASKS: [(&str, u8); 3] = [("keepout", 0), ("speed", 1), ("zones", 4)];

/// Arguments of `export nav2`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A heat, such as the `heat.parquet` that `annotate` writes.
    heat: PathBuf,
    /// YAML of the map of ROS that the robot uses: masks get its grid, resolution and origin [default: those of the heat].
    #[arg(long, value_name = "YAML")]
    map: Option<PathBuf>,
    #[command(flatten)]
    out: OutFolder,
    /// Value of the busiest floor in the keepout mask, 0 to 99; 100 could not be crossed.
    #[arg(long, value_name = "VALUE", default_value_t = MOST, value_parser = clap::value_parser!(u8).range(0..=i64::from(MOST)))]
    most: u8,
    /// Speed on the busiest floor, in percent of the robot's most.
    #[arg(long, value_name = "PERCENT", default_value_t = 40, value_parser = clap::value_parser!(u8).range(1..=100))]
    slowest: u8,
    /// Number of zones for the zone filter.
    #[arg(long, value_name = "NUMBER", default_value_t = 3, value_parser = clap::value_parser!(u8).range(2..=16))]
    zones: u8,
}

impl Args {
    pub(super) fn run(&self, screen: &Screen) -> Result<(), CliError> {
        let masks = MASKS.map(|(name, _)| [format!("{name}_mask.pgm"), format!("{name}_mask.yaml")]);
        let names: Vec<&str> =
            masks.iter().flatten().map(String::as_str).chain(["nav2_params.yaml", "README.md"]).collect();
        let inputs: Vec<PathBuf> = std::iter::once(&self.heat).chain(&self.map).cloned().collect();
        self.out.check(&names, &inputs)?;
        let heat = Placed::<Heat>::from_bytes(read(&self.heat)?)?;
        let (free, frame) = match &self.map {
            Some(map) => grid_of(map)?,
            None => (heat.value.free.clone(), heat.frame),
        };
        let told = masks::carried(&heat.value.heat, &heat.value.free, &heat.frame, &free, &frame);
        if told.as_slice().iter().all(Option::is_none) {
            let map = self.map.as_deref().unwrap_or(&self.heat).display();
            let what = format!("no free cell of `{map}` lies where `{}` says something", self.heat.display());
            return Err(CliError::advised(what, "give the map that the heat was made of"));
        }
        let values = [masks::keepout(&told, self.most), masks::percent(&told), masks::zones(&told, self.zones)];
        let mut files: Vec<(&str, Vec<u8>)> = Vec::new();
        for ([image, yaml], values) in masks.iter().zip(&values) {
            files.push((image, pgm(values)));
            files.push((yaml, description(image, &frame).into_bytes()));
        }
        files.push(("nav2_params.yaml", self.parameters().into_bytes()));
        files.push(("README.md", self.readme().into_bytes()));
        self.out.write(&files, screen)
    }

    /// Writes the parameters of the servers and filters.
    fn parameters(&self) -> String {
        let mut text = String::from("# Paste what you need into the parameters of your robot.\n");
        let speed = -(100.0 - f64::from(self.slowest)) / 100.0;
        for (name, kind) in MASKS {
            let (base, multiplier) = if name == "speed" { (100.0, speed) } else { (0.0, 1.0) };
            text.push_str(&format!(
                "{name}_filter_mask_server:
  ros__parameters:
    yaml_filename: {name}_mask.yaml
    topic_name: /{name}_filter_mask
    frame_id: map
{name}_costmap_filter_info_server:
  ros__parameters:
    type: {kind}
    filter_info_topic: /{name}_costmap_filter_info
    mask_topic: /{name}_filter_mask
    base: {base:.1}
    multiplier: {multiplier:?}
"
            ));
        }
        text.push_str(
            "global_costmap:
  global_costmap:
    ros__parameters:
      filters: [keepout_filter, speed_filter]
      keepout_filter:
        plugin: nav2_costmap_2d::KeepoutFilter
        enabled: true
        filter_info_topic: /keepout_costmap_filter_info
      speed_filter:
        plugin: nav2_costmap_2d::SpeedFilter
        enabled: true
        filter_info_topic: /speed_costmap_filter_info
        speed_limit_topic: /speed_limit
local_costmap:
  local_costmap:
    ros__parameters:
      filters: [zone_filter]
      zone_filter:
        plugin: nav2_costmap_2d::ZoneParameterFilter
        enabled: true
        filter_info_topic: /zones_costmap_filter_info
        # An example: the largest speed of a controller, less in each zone. Set the node, the parameter and the values that
        # your robot has; the values under nominal_defaults are set outside of all zones.
        nominal_defaults: [speed]
        nominal_defaults.speed:
          node: controller_server
          parameter: FollowPath.max_vel_x
          value: 0.5
",
        );
        let states: Vec<String> = (1..=self.zones).map(|zone| format!("busy_{zone}")).collect();
        text.push_str(&format!("        states: [{}]\n", states.join(", ")));
        for (zone, state) in (1..).zip(&states) {
            let busy = f64::from(zone - 1) / f64::from(self.zones - 1);
            let value = 0.5 * (1.0 + speed * busy);
            text.push_str(&format!(
                "        {state}:
          id: {zone}
          setpoints: [speed]
          speed:
            node: controller_server
            parameter: FollowPath.max_vel_x
            value: {value:.3}
"
            ));
        }
        text
    }

    fn readme(&self) -> String {
        let Self { most, slowest, zones, .. } = self;
        format!(
            "# Where people walk, for Nav2

Masks of one grid, `mode: raw`: a pixel is the value of its cell.

- `keepout_mask`: 0 where nobody walks to {most} where most people do, 255 (unknown) where nothing is said. A keepout filter
  makes the cost value · 254 / 100 of it, {cost} at most: the floor stays crossable, and planners go around where it is cheap.
- `speed_mask`: the same in percent. With base 100 and the multiplier in `nav2_params.yaml` the robot goes at full speed where
  nobody walks, and at {slowest} % of it on the busiest floor.
- `zones_mask`: zones 1 to {zones} by rising heat for a zone parameter filter; 0 is the nominal state.

A value is a rank: the share of the floor on which fewer people walk. `nav2_params.yaml` has the servers, the filters and their
topics; all servers are lifecycle nodes and want to be started by a lifecycle manager.
",
            cost = (f64::from(*most) * 254.0 / 100.0).round()
        )
    }
}

/// Reads which cells of a map of ROS are free, on its own grid.
fn grid_of(path: &Path) -> Result<(Grid<bool>, Frame), CliError> {
    let failed = |error: &dyn std::fmt::Display| CliError::request(format!("`{}`: {error}", path.display()));
    let text = String::from_utf8(read(path)?).map_err(|error| failed(&error))?;
    let yaml = MapYaml::parse(&text).map_err(|error| failed(&error))?;
    let image = read(&path.parent().unwrap_or(Path::new("")).join(&yaml.image))?;
    free_pixels(&yaml, &image).map_err(|error| failed(&error))
}

pub(super) fn read(path: &Path) -> Result<Vec<u8>, CliError> {
    read_bounded(path, MOST_BYTES).map_err(|source| CliError::File { action: "read", path: path.to_owned(), source })
}

/// Writes a binary PGM.
fn pgm(values: &Grid<u8>) -> Vec<u8> {
    let mut bytes = format!("P5\n{} {}\n255\n", values.cols(), values.rows()).into_bytes();
    bytes.extend_from_slice(values.as_slice());
    bytes
}

/// Writes the YAML that `map_server` reads beside an image.
fn description(image: &str, frame: &Frame) -> String {
    let Frame { resolution, origin, yaw, .. } = frame;
    format!(
        "image: {image}\nmode: raw\nresolution: {resolution}\norigin: [{:?}, {:?}, {yaw:?}]\nnegate: 0\n\
         occupied_thresh: 0.65\nfree_thresh: 0.25\n",
        origin.x, origin.y
    )
}
