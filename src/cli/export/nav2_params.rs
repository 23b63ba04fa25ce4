//! Parameters of Nav2 for masks and route graphs, to paste.

/// The masks by name, with the type of their filter: 0 keepout, 1 speed in percent of the most, 4 zones.
pub(super) const MASKS: [(&str, u8); 3] = [("keepout", 0), ("speed", 1), ("zones", 4)];

/// Writes the parameters of the servers and filters: on the busiest floor the robot goes at `slowest` percent of its speed, there
/// are so many `zones`, and the route server reads `graph`, if there is one.
pub(super) fn parameters(slowest: u8, zones: u8, graph: Option<&str>) -> String {
    let mut text = String::from("# Paste what you need into the parameters of your robot.\n");
    let speed = -(100.0 - f64::from(slowest)) / 100.0;
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
    text.push_str(&graph.map(route_server).unwrap_or_default());
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
    let states: Vec<String> = (1..=zones).map(|zone| format!("busy_{zone}")).collect();
    text.push_str(&format!("        states: [{}]\n", states.join(", ")));
    for (zone, state) in (1..).zip(&states) {
        let busy = f64::from(zone - 1) / f64::from(zones - 1);
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

/// Writes the parameters of the route server.
fn route_server(graph: &str) -> String {
    format!(
        "route_server:
  ros__parameters:
    graph_filepath: {graph}
    graph_file_loader: GeoJsonGraphFileLoader
    GeoJsonGraphFileLoader:
      plugin: nav2_route::GeoJsonGraphFileLoader
    edge_cost_functions: [DistanceScorer, PenaltyScorer, DynamicEdgesScorer]
    DistanceScorer:
      plugin: nav2_route::DistanceScorer
    PenaltyScorer:
      plugin: nav2_route::PenaltyScorer
      penalty_tag: penalty
      # How much people count, beside the length of the way.
      weight: 1.0
    DynamicEdgesScorer:
      plugin: nav2_route::DynamicEdgesScorer
"
    )
}
