//! `import-map`: the maps of others, from the bytes of their files.
//!
//! What stands in a file is first classified pixel by pixel, then resampled, and the regions that are wanted are kept.

use super::config::ImportConfig;
use super::error::MapImportError;
use super::form::MapForm;
use super::indoors::{Survey, choose};
use super::occupancy::{MapError, OccupancyMap};
use super::picture::{Picture, Pixel, Shade, flipped};
use super::reading::Reading;
use super::resample::resample;
use super::ros::MapYaml;
use crate::domain::geometry::{Frame, Grid, Point};

/// The edge of a pixel of an [iGibson picture](igibson_image) in meters.
pub const IGIBSON_RESOLUTION: f64 = 0.01;

/// How far from zero the origin of a grid may lie, in meters: maps in metric grids of the Earth lie within 10⁷ m.
const FARTHEST: f64 = 1e8;

/// A map that was read, and what became of its free floor.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// The map.
    pub map: OccupancyMap,
    /// What was found on the way, and how much of it was kept.
    pub survey: Survey,
    /// What was read of a floor plan, and what was not; pictures have nothing to tell.
    pub reading: Reading,
}

/// Returns the name of the picture of the space on a floor that can be walked on, in an iGibson scene's folder or in the
/// folder `layout` of that.
#[must_use]
pub fn igibson_image(floor: u32) -> String {
    format!("floor_trav_{floor}.png")
}

/// Returns the floor whose [picture](igibson_image) has this name, if any has.
#[must_use]
pub fn igibson_floor(name: &str) -> Option<u32> {
    let number = name.strip_prefix("floor_trav_")?.strip_suffix(".png")?;
    number.parse().ok().filter(|floor| igibson_image(*floor) == name)
}

/// Reads a map of ROS `map_server` from its parsed YAML and the bytes of the image that the YAML names.
///
/// # Errors
/// [`MapImportError`] if a parameter is out of range, the image is damaged or too large, or hardly anything is free.
pub fn import_ros(yaml: &MapYaml, image: &[u8], config: &ImportConfig) -> Result<Imported, MapImportError> {
    config.check()?;
    let yaml = yaml.overridden(config)?;
    let (pixels, frame, picture) = pixels_of_ros(&yaml, image)?;
    finish(&pixels, yaml.resolution, MapForm::Ros, config, |_| frame).map_err(|error| explained(error, &picture))
}

/// Takes cells that somebody has at hand, `true` for free ones, as [`import_image`] takes the pixels of a picture.
///
/// # Errors
/// [`MapImportError`] if there are no cells, a parameter or the frame is out of range, or hardly anything is free.
pub fn import_grid(free: &Grid<bool>, frame: &Frame, config: &ImportConfig) -> Result<Imported, MapImportError> {
    ImportConfig { image_resolution: Some(frame.resolution), ..config.clone() }.check()?;
    for (field, value) in [("origin", frame.origin.x), ("origin", frame.origin.y), ("yaw", frame.yaw)] {
        if !(-FARTHEST..=FARTHEST).contains(&value) {
            return Err(MapImportError::Parameter { field, value, low: -FARTHEST, high: FARTHEST });
        }
    }
    if free.is_empty() {
        return Err(MapError::NoFreeSpace.into());
    }
    let pixels = free.map(|free| if *free { Pixel::Free } else { Pixel::Occupied });
    finish(&pixels, frame.resolution, MapForm::Image, config, |_| *frame)
}

/// Reads which pixels of a map of ROS `map_server` are free, on the grid of the image itself.
///
/// # Errors
/// [`MapImportError`] if the image is damaged or too large.
pub fn free_pixels(yaml: &MapYaml, image: &[u8]) -> Result<(Grid<bool>, Frame), MapImportError> {
    let (pixels, frame, _) = pixels_of_ros(yaml, image)?;
    Ok((pixels.map(|pixel| *pixel == Pixel::Free), frame))
}

/// Reads what the pixels of a map of ROS show, and where they lie.
fn pixels_of_ros(yaml: &MapYaml, image: &[u8]) -> Result<(Grid<Pixel>, Frame, Picture), MapImportError> {
    let mut picture = Picture::decode(image)?;
    if !yaml.negate {
        picture.settle_unknown();
    }
    let pixels = picture.classify(|shade| yaml.pixel(shade));
    let origin = Point::new(yaml.origin[0], yaml.origin[1]);
    let frame = Frame { origin, yaw: yaml.origin[2], ..Frame::at_zero(yaml.resolution, pixels.rows(), pixels.cols()) };
    Ok((pixels, frame, picture))
}

/// Reads a plain image: bright is free, dark is occupied, transparent is unknown.
///
/// Where hardly anything else is bright, transparent is white paper: many drawings are black lines on nothing. The gray
/// value 205 means nothing here. The lower left corner becomes the origin.
///
/// # Errors
/// [`MapImportError`] if `image_resolution` and `scale` are missing or both given, a parameter is out of range, the image is damaged or too large,
/// or hardly anything is free.
pub fn import_image(image: &[u8], config: &ImportConfig) -> Result<Imported, MapImportError> {
    config.check()?;
    let resolution = config.pixel().ok_or(MapImportError::ImageResolution)?;
    let picture = Picture::decode(image)?;
    let mut pixels = picture.classify(|shade| plain_pixel(shade, config));
    if let Some(scale) = config.scale {
        let (width, height) = (pixels.cols(), pixels.rows());
        if let Some(Point { x, y }) = scale.outside(width, height) {
            return Err(MapImportError::ScaleOutside { x, y, width, height });
        }
    }
    let paper = config.negate != Some(true) && is_drawn_on_nothing(&picture, &pixels);
    if paper {
        pixels = picture.classify(|shade| plain_pixel(on_paper(shade), config));
    }
    let imported = finish(&pixels, resolution, MapForm::Image, config, |frame| frame);
    let imported = imported.map_err(|error| explained(error, &picture))?;
    Ok(Imported { survey: Survey { paper, ..imported.survey }, ..imported })
}

/// Reads a picture [`igibson_image`] of an iGibson scene: white can be walked on, all else cannot.
///
/// In iGibson the world's origin is the middle of the picture and y grows with its rows. So that coordinates are the
/// simulator's, the picture is turned upside down: its last row becomes row 0, the one with the largest y.
///
/// # Errors
/// [`MapImportError`] if a parameter is out of range, the image is damaged or too large, or hardly anything is free.
pub fn import_igibson(image: &[u8], config: &ImportConfig) -> Result<Imported, MapImportError> {
    config.check()?;
    let white = |shade: Shade| if shade.gray == u8::MAX { Pixel::Free } else { Pixel::Occupied };
    let pixels = flipped(&Picture::decode(image)?.classify(white));
    finish(&pixels, IGIBSON_RESOLUTION, MapForm::Igibson, config, |frame| Frame {
        origin: Point::new(-0.5 * frame.cols as f64 * frame.resolution, -0.5 * frame.rows as f64 * frame.resolution),
        ..frame
    })
}

fn plain_pixel(shade: Shade, config: &ImportConfig) -> Pixel {
    if is_transparent(shade) {
        return Pixel::Unknown;
    }
    let gray = if config.negate == Some(true) { u8::MAX - shade.gray } else { shade.gray };
    let threshold = config.threshold.unwrap_or(ImportConfig::THRESHOLD);
    if f64::from(gray) >= threshold * 255.0 { Pixel::Free } else { Pixel::Occupied }
}

const fn is_transparent(shade: Shade) -> bool {
    shade.alpha < 128
}

/// Tells whether less than a hundredth as many pixels are free as are transparent.
fn is_drawn_on_nothing(picture: &Picture, pixels: &Grid<Pixel>) -> bool {
    let free = pixels.as_slice().iter().filter(|pixel| **pixel == Pixel::Free).count();
    100 * free < transparent(picture, is_transparent)
}

fn transparent(picture: &Picture, counts: impl Fn(Shade) -> bool) -> usize {
    let marked = picture.classify(|shade| if counts(shade) { Pixel::Unknown } else { Pixel::Occupied });
    marked.as_slice().iter().filter(|pixel| **pixel == Pixel::Unknown).count()
}

/// Lays a pixel on white paper.
fn on_paper(shade: Shade) -> Shade {
    let (gray, alpha) = (u32::from(shade.gray), u32::from(shade.alpha));
    Shade { gray: ((gray * alpha + 255 * (255 - alpha) + 127) / 255) as u8, alpha: u8::MAX, ..shade }
}

/// Says that nothing is free because of what is transparent, where that is so.
fn explained(error: MapImportError, picture: &Picture) -> MapImportError {
    if !matches!(error, MapImportError::Map(MapError::NoFreeSpace)) {
        return error;
    }
    let percent = 100.0 * transparent(picture, |shade| shade.alpha < u8::MAX) as f64 / picture.len() as f64;
    if percent >= 10.0 { MapImportError::Transparent { percent } } else { error }
}

fn finish(
    pixels: &Grid<Pixel>,
    resolution: f64,
    form: MapForm,
    config: &ImportConfig,
    place: impl FnOnce(Frame) -> Frame,
) -> Result<Imported, MapImportError> {
    let frame = place(Frame::at_zero(resolution, pixels.rows(), pixels.cols()));
    let (cells, frame) = resample(pixels, &frame, config.resolution)?;
    let (map, survey) = choose(&cells, &frame, form, config.region)?;
    Ok(Imported { map, survey, reading: Reading::default() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::Cell;

    /// A binary PGM of rows of gray values.
    fn pgm(rows: &[&[u8]]) -> Vec<u8> {
        let mut bytes = format!("P5 {} {} 255\n", rows[0].len(), rows.len()).into_bytes();
        rows.iter().for_each(|row| bytes.extend_from_slice(row));
        bytes
    }

    fn drawn(map: &OccupancyMap) -> Vec<String> {
        (0..map.free().rows())
            .map(|row| map.free().row(row).iter().map(|free| if *free { '.' } else { '#' }).collect())
            .collect()
    }

    fn plain() -> ImportConfig {
        // Cells of a square meter each, so that one alone is a map.
        ImportConfig { image_resolution: Some(1.0), resolution: 1.0, ..ImportConfig::default() }
    }

    /// Rows of gray values with a black wall around them.
    fn walled(rows: &[&[u8]]) -> Vec<u8> {
        let wall = vec![0; rows[0].len() + 2];
        let inner = rows.iter().map(|row| [&[0], *row, &[0]].concat());
        let all: Vec<Vec<u8>> = std::iter::once(wall.clone()).chain(inner).chain([wall]).collect();
        pgm(&all.iter().map(Vec::as_slice).collect::<Vec<_>>())
    }

    #[test]
    fn a_plain_image_is_split_at_its_threshold() {
        let image = walled(&[&[255, 128, 127, 205, 0]]);
        let import = |config: &ImportConfig| drawn(&import_image(&image, config).expect("a map").map);
        assert_eq!(import(&plain()), ["####", "#..#", "####"]);
        let dark = ImportConfig { threshold: Some(0.4), ..plain() };
        // 205 means nothing in a plain image.
        assert_eq!(import(&dark), ["######", "#....#", "######"]);
        let negated = ImportConfig { negate: Some(true), region: super::super::Region::All, ..plain() };
        assert_eq!(import(&negated)[2], "#.##.#..#");
    }

    #[test]
    fn a_scale_is_as_good_as_a_resolution() {
        let image = walled(&[&[255, 255, 255, 255]]);
        let by = |scale: &str| {
            let scale = Some(scale.parse().expect("a scale"));
            import_image(&image, &ImportConfig { scale, image_resolution: None, ..plain() })
        };
        assert_eq!(by("1,0:5,0=4m").expect("a map"), import_image(&image, &plain()).expect("a map"));
        assert_eq!(by("1,3:5,0=10m").expect("a map").map.free_area(), 16.0);
        let error = by("1,0:7,0=4m").expect_err("the picture is 6 × 3").to_string();
        assert_eq!(error, "the point 7, 0 of `scale` lies outside of the picture of 6 × 3 pixels");
    }

    fn ros(more: &str) -> MapYaml {
        let yaml = format!("image: m.pgm\nresolution: 1\norigin: [-3, 7, 0.5]\n{more}");
        MapYaml::parse(&yaml).expect("a map's description")
    }

    fn coarse() -> ImportConfig {
        ImportConfig { resolution: 1.0, ..ImportConfig::default() }
    }

    #[test]
    fn a_ros_map_keeps_its_origin() {
        let yaml = ros("occupied_thresh: 0.65\nfree_thresh: 0.25").clone();
        let yaml = MapYaml { resolution: 0.5, ..yaml };
        // Two cells, each of 2 × 2 pixels; the upper one is unknown, which a threshold of 0.25 would call free.
        let image = pgm(&[&[205, 205], &[205, 205], &[254, 205], &[254, 254]]);
        let map = import_ros(&yaml, &image, &coarse()).expect("a map").map;
        assert_eq!(drawn(&map), ["###", "#.#", "###"]);
        let frame = map.frame();
        let corner = frame.to_map(Point::new(1.0, 1.0));
        assert!(corner.distance(Point::new(-3.0, 7.0)) < 1e-12 && frame.yaw == 0.5, "{corner:?}");
    }

    #[test]
    fn unknown_space_stays_unknown_in_a_jpeg() {
        // A room of 40 × 40 with an unknown corner, in unknown space: rippled by up to a dozen.
        let gray = |x: u32, y: u32| {
            let room = (10..50).contains(&x) && (10..50).contains(&y);
            let wall = (9..=50).contains(&x) && (9..=50).contains(&y);
            let hidden = (40..50).contains(&x) && (40..50).contains(&y);
            image::Luma([if room && !hidden {
                254
            } else if wall && !room {
                0
            } else {
                205
            }])
        };
        let image = image::GrayImage::from_fn(60, 60, gray);
        let yaml = ros("occupied_thresh: 0.65\nfree_thresh: 0.25");
        for quality in [60, 75, 95] {
            let mut bytes = Vec::new();
            let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, quality);
            image.write_with_encoder(encoder).expect("encodes");
            let imported = import_ros(&yaml, &bytes, &coarse()).expect("a map");
            let cells = imported.map.free_cells();
            assert!((1485..=1500).contains(&cells), "quality {quality}: {cells} instead of 1500");
            assert_eq!(imported.survey.kept, imported.survey.indoors, "quality {quality}: {}", imported.survey);
        }
    }

    #[test]
    fn a_resolution_in_float32_gives_the_same_cells() {
        let rows: Vec<Vec<u8>> = (0..200)
            .map(|row: usize| {
                let wall =
                    |col| (usize::is_multiple_of(row, 50) || usize::is_multiple_of(col, 50)) && (row + col) % 50 > 20;
                (0..700usize).map(|col| 254 * u8::from(!wall(col))).collect()
            })
            .collect();
        let image = pgm(&rows.iter().map(Vec::as_slice).collect::<Vec<_>>());
        let thresholds = ros("occupied_thresh: 0.65\nfree_thresh: 0.25");
        for resolution in [0.1, 0.05, 0.025, 0.03, 0.07, 0.02] {
            let import = |resolution| {
                let yaml = MapYaml { resolution, ..thresholds.clone() };
                import_ros(&yaml, &image, &ImportConfig::default()).expect("a map")
            };
            assert_eq!(import(f64::from(resolution as f32)), import(resolution), "{resolution}");
        }
    }

    #[test]
    fn what_is_left_out_is_told() {
        let two = walled(&[&[255, 255, 0, 255], &[255, 255, 0, 255]]);
        let survey = |region| {
            let config = ImportConfig { region, ..plain() };
            import_image(&two, &config).expect("a map").survey
        };
        use super::super::Region::{All, At, Largest};
        let kept = survey(Largest);
        assert_eq!((kept.kept, kept.indoors, kept.regions, kept.is_odd()), (4.0, 6.0, 2, true));
        assert_eq!(kept.to_string(), "kept 4.0 of 6.0 m² of free floor (66.6 %), the largest of 2 regions");
        assert_eq!(survey(All).to_string(), "kept 6.0 of 6.0 m² of free floor (100.0 %)");
        assert_eq!(survey(At(4.5, 1.2)).kept, 2.0);
        let config = ImportConfig { region: At(40.0, 1.0), ..plain() };
        let error = import_image(&two, &config).expect_err("outside");
        assert_eq!(error.to_string(), "there is no free floor at 40, 1: the map reaches from 0, 0 to 6, 4");
    }

    #[test]
    fn a_map_of_less_than_a_square_meter_is_refused() {
        let row = [255u8; 9];
        let config = ImportConfig { image_resolution: Some(0.1), ..ImportConfig::default() };
        let error = import_image(&walled(&[&row[..]; 11]), &config).expect_err("0.99 m²");
        assert!(matches!(error, MapImportError::TooSmall { area } if (area - 0.99).abs() < 1e-9), "{error}");
        import_image(&walled(&[&[255u8; 10][..]; 10]), &config).expect("1 m²");
    }

    /// A PNG of gray and opacity.
    fn transparent_png(pixel: impl Fn(u32, u32) -> [u8; 2]) -> Vec<u8> {
        let image = image::GrayAlphaImage::from_fn(20, 20, |x, y| image::LumaA(pixel(x, y)));
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write_to(&mut bytes, image::ImageFormat::Png).expect("encodes");
        bytes.into_inner()
    }

    /// The walls of a room from 4 to 15.
    fn is_wall(x: u32, y: u32) -> bool {
        let within = |at| (4..=15).contains(&at);
        within(x) && within(y) && !((5..=14).contains(&x) && (5..=14).contains(&y))
    }

    #[test]
    fn a_drawing_on_nothing_lies_on_white_paper() {
        let lines = transparent_png(|x, y| if is_wall(x, y) { [0, 255] } else { [0, 0] });
        let imported = import_image(&lines, &plain()).expect("a map");
        assert_eq!((imported.survey.kept, imported.survey.outdoors, imported.survey.paper), (100.0, 256.0, true));
        // With rooms that are painted white, what is transparent is unknown.
        let inside = |x, y| (5..=14).contains(&x) && (5..=14).contains(&y);
        let painted = transparent_png(|x, y| {
            if inside(x, y) {
                [255, 255]
            } else {
                [255 * u8::from(!is_wall(x, y)), if is_wall(x, y) { 255 } else { 0 }]
            }
        });
        let imported = import_image(&painted, &plain()).expect("a map");
        assert_eq!((imported.survey.kept, imported.survey.outdoors, imported.survey.paper), (100.0, 0.0, false));
    }

    #[test]
    fn a_grid_at_hand_is_what_its_picture_is() {
        let image = walled(&[&[255, 255, 0, 255], &[255, 255, 0, 255]]);
        let free =
            Grid::from_fn(4, 6, |cell| (1..3).contains(&cell.row) && (1..5).contains(&cell.col) && cell.col != 3);
        let frame = Frame::at_zero(1.0, 4, 6);
        let imported = import_grid(&free, &frame, &coarse()).expect("a map");
        assert_eq!(imported, import_image(&image, &plain()).expect("a map"));
        // With an origin of its own it lies elsewhere.
        let away = Frame { origin: Point::new(10.0, -2.0), yaw: 0.5, ..frame };
        let moved = import_grid(&free, &away, &coarse()).expect("a map").map;
        assert_eq!(moved.free(), imported.map.free());
        let center = |map: &OccupancyMap| map.frame().to_map(map.frame().center(Cell::new(1, 1)));
        assert!(away.to_map(center(&imported.map)).distance(center(&moved)) < 1e-9);
        for (free, frame) in [
            (Grid::filled(0, 6, true), Frame { rows: 0, ..frame }),
            (Grid::filled(4, 6, false), frame),
            (free.clone(), Frame { resolution: f64::NAN, ..frame }),
            (free.clone(), Frame { yaw: f64::INFINITY, ..frame }),
        ] {
            import_grid(&free, &frame, &coarse()).expect_err("no map");
        }
    }

    #[test]
    fn a_transparent_map_of_ros_says_so() {
        let lines = transparent_png(|x, y| if is_wall(x, y) { [0, 255] } else { [255, 0] });
        let yaml = ros("occupied_thresh: 0.65\nfree_thresh: 0.25");
        let error = import_ros(&yaml, &lines, &coarse()).expect_err("nothing is free");
        assert!(error.to_string().contains("89 % of its pixels are transparent"), "{error}");
    }

    #[test]
    fn a_comment_in_the_header_changes_nothing() {
        let image = walled(&[&[255, 0, 255, 255]]);
        let commented = [b"P5\n6#saved\n3 255\n".as_slice(), &image[image.len() - 18..]].concat();
        let import = |bytes: &[u8]| import_image(bytes, &plain()).expect("a map");
        assert_eq!(import(&image), import(&commented));
    }

    #[test]
    fn a_plain_image_needs_a_resolution() {
        let error = import_image(&pgm(&[&[255]]), &ImportConfig::default()).expect_err("no scale");
        assert!(matches!(error, MapImportError::ImageResolution), "{error}");
    }

    #[test]
    fn a_map_without_free_space_is_an_error() {
        let error = import_image(&pgm(&[&[0, 100]]), &plain()).expect_err("all is blocked");
        assert!(matches!(error, MapImportError::Map(MapError::NoFreeSpace)), "{error}");
    }

    #[test]
    fn igibson_lies_around_the_middle_with_y_along_the_rows() {
        // 400 × 400 pixels of 0.01 m; free is the upper left quarter, that is, negative x and negative y.
        let rows: Vec<Vec<u8>> =
            (0..400).map(|row| (0..400).map(|col| if row < 200 && col < 200 { 255 } else { 254 }).collect()).collect();
        let rows: Vec<&[u8]> = rows.iter().map(Vec::as_slice).collect();
        let map = import_igibson(&pgm(&rows), &coarse()).expect("a map").map;
        assert_eq!(drawn(&map), ["####", "#..#", "#..#", "####"]);
        let center = map.frame().to_map(map.frame().center(Cell::new(1, 1)));
        assert!((center.x - -1.5).abs() < 1e-12 && (center.y - -0.5).abs() < 1e-12, "{center:?}");
    }

    #[test]
    fn the_picture_of_a_floor_is_known_by_its_name() {
        for floor in [0, 1, 12] {
            assert_eq!(igibson_floor(&igibson_image(floor)), Some(floor));
        }
        for other in
            ["floor_trav_no_obj_0.png", "floor_trav_01.png", "floor_trav_.png", "floor_0.png", "floor_trav_0.pgm"]
        {
            assert_eq!(igibson_floor(other), None, "{other}");
        }
    }

    #[test]
    fn the_grid_of_a_huge_map_is_refused() {
        let config = ImportConfig { resolution: 0.01, image_resolution: Some(10.0), ..plain() };
        let row = [255u8; 64];
        let error = import_image(&pgm(&[&row[..]; 64]), &config).expect_err("64,000 × 64,000 cells");
        assert!(matches!(error, MapImportError::TooManyPixels { width: 64_000, .. }), "{error}");
    }
}
