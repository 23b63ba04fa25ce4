//! How large a picture is, by two of its points and how far apart they are.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::domain::geometry::Point;

/// Two points of a picture and their distance, written `120,80:620,80=12.5m`.
///
/// Points are counted in pixels from the upper left corner, to the right and down, as programs for pictures show them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(with = "String")]
pub struct ScaleBar {
    from: Point,
    to: Point,
    /// In meters.
    distance: f64,
}

impl ScaleBar {
    /// Returns the edge of a pixel in meters.
    #[must_use]
    pub fn pixel(&self) -> f64 {
        self.distance / self.from.distance(self.to)
    }

    /// Returns a point that does not lie in a picture of this size in pixels, if one does not.
    #[must_use]
    pub fn outside(&self, width: usize, height: usize) -> Option<Point> {
        let within = |value: f64, most: usize| (0.0..=most as f64).contains(&value);
        [self.from, self.to].into_iter().find(|point| !(within(point.x, width) && within(point.y, height)))
    }
}

impl fmt::Display for ScaleBar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{}:{},{}={}m", self.from.x, self.from.y, self.to.x, self.to.y, self.distance)
    }
}

impl FromStr for ScaleBar {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse().ok().filter(|value: &f64| value.is_finite());
        let point = |text: &str| {
            let (x, y) = text.split_once(',')?;
            Some(Point::new(number(x)?, number(y)?))
        };
        let parse = || {
            let (points, distance) = text.split_once('=')?;
            let (from, to) = points.split_once(':')?;
            let distance = number(distance.trim().strip_suffix('m')?).filter(|distance| *distance > 0.0)?;
            let bar = Self { from: point(from)?, to: point(to)?, distance };
            (bar.from != bar.to).then_some(bar)
        };
        parse().ok_or_else(|| {
            format!(
                "`scale` must be two points in pixels and their distance, such as `120,80:620,80=12.5m`, not `{text}`"
            )
        })
    }
}

impl TryFrom<String> for ScaleBar {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<ScaleBar> for String {
    fn from(bar: ScaleBar) -> Self {
        bar.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_points_and_their_distance_make_a_scale() {
        let check = |text: &str, pixel: f64, shown: &str| {
            let bar: ScaleBar = text.parse().expect("a scale");
            assert_eq!((bar.pixel(), bar.to_string().as_str()), (pixel, shown), "{text}");
            assert_eq!(shown.parse(), Ok(bar));
        };
        check("120,80:620,80=12.5m", 0.025, "120,80:620,80=12.5m");
        check(" 3.5 , 0 : 0.5 , 4 = 10 m", 2.0, "3.5,0:0.5,4=10m");
        let bar: ScaleBar = "120,80:620,80=12.5m".parse().expect("a scale");
        assert_eq!((bar.outside(620, 80), bar.outside(619, 80)), (None, Some(Point::new(620.0, 80.0))));
    }

    #[test]
    fn what_is_no_scale_is_refused() {
        let wrong = [
            "",
            "12.5m",
            "1,2:3,4",
            "1,2:3,4=5",
            "1,2:3,4=5cm",
            "1,2:3=5m",
            "1,2:1,2=5m",
            "1,2:3,4=0m",
            "1,2:3,4=-1m",
            "a,2:3,4=5m",
            "1,2:nan,4=5m",
            "1,2:3,4=infm",
            "1,2,3:3,4=5m",
        ];
        for text in wrong {
            let error = text.parse::<ScaleBar>().expect_err(text);
            assert!(error.ends_with(&format!("such as `120,80:620,80=12.5m`, not `{text}`")), "{error}");
        }
    }
}
