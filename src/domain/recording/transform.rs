//! From the frame of a recording to that of a map.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::RecordingError;
use crate::domain::geometry::Point;

/// A projective map of the plane: of (x, y, 1) by a matrix, divided by the third number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "TransformFields", into = "TransformFields")]
pub struct Transform([[f64; 3]; 3]);

/// A transform as a pipeline file has it: one of the three.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TransformFields {
    /// Angle in radians by which the recording is turned, counter-clockwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub yaw: Option<f64>,
    /// Meters by which it is then moved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<[f64; 2]>,
    /// Two positions of the recording in meters, each with where it lies on the map: turned, scaled and moved to fit both.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pairs: Option<[[[f64; 2]; 2]; 2]>,
    /// Rows of a matrix that takes (x, y, 1) to the map, up to a factor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub homography: Option<[[f64; 3]; 3]>,
}

impl Transform {
    /// Takes a position to the frame of the map.
    #[must_use]
    pub fn apply(&self, Point { x, y }: Point) -> Point {
        let [a, b, c] = self.0.map(|row| row[0] * x + row[1] * y + row[2]);
        Point::new(a / c, b / c)
    }

    fn similarity([cos, sin]: [f64; 2], [x, y]: [f64; 2]) -> Self {
        Self([[cos, -sin, x], [sin, cos, y], [0.0, 0.0, 1.0]])
    }
}

impl TryFrom<TransformFields> for Transform {
    type Error = RecordingError;

    fn try_from(fields: TransformFields) -> Result<Self, RecordingError> {
        let transform = match fields {
            TransformFields { yaw, offset, pairs: None, homography: None } if yaw.is_some() || offset.is_some() => {
                let yaw = yaw.unwrap_or(0.0);
                Self::similarity([libm::cos(yaw), libm::sin(yaw)], offset.unwrap_or_default())
            }
            TransformFields { yaw: None, offset: None, pairs: Some([[a, to_a], [b, to_b]]), homography: None } => {
                // As complex numbers: the factor is the quotient of the differences.
                let (from, to) = ([b[0] - a[0], b[1] - a[1]], [to_b[0] - to_a[0], to_b[1] - to_a[1]]);
                let length = from[0] * from[0] + from[1] * from[1];
                if !(length > 0.0 && to != [0.0, 0.0]) {
                    return Err(RecordingError::NoTransform("needs two different positions".to_owned()));
                }
                let cos = (to[0] * from[0] + to[1] * from[1]) / length;
                let sin = (to[1] * from[0] - to[0] * from[1]) / length;
                let offset = [to_a[0] - cos * a[0] + sin * a[1], to_a[1] - sin * a[0] - cos * a[1]];
                Self::similarity([cos, sin], offset)
            }
            TransformFields { yaw: None, offset: None, pairs: None, homography: Some(matrix) } => {
                let [[a, b, c], [d, e, f], [g, h, i]] = matrix;
                let determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
                if determinant == 0.0 {
                    return Err(RecordingError::NoTransform("is a matrix without an inverse".to_owned()));
                }
                Self(matrix)
            }
            _ => {
                let what = "is one of `{ yaw, offset }`, `{ pairs }` and `{ homography }`";
                return Err(RecordingError::NoTransform(what.to_owned()));
            }
        };
        if transform.0.iter().flatten().all(|number| number.is_finite()) {
            Ok(transform)
        } else {
            Err(RecordingError::NoTransform("has numbers that are not finite".to_owned()))
        }
    }
}

impl From<Transform> for TransformFields {
    fn from(Transform(matrix): Transform) -> Self {
        Self { homography: Some(matrix), ..Self::default() }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn read(value: Value) -> Result<Transform, String> {
        serde_json::from_value(value).map_err(|error| error.to_string())
    }

    /// Applies a transform and compares.
    fn check(value: Value, from: [f64; 2], to: [f64; 2]) {
        let transform = read(value).expect("a transform");
        let found = transform.apply(Point::new(from[0], from[1]));
        assert!((found.x - to[0]).abs() < 1e-12 && (found.y - to[1]).abs() < 1e-12, "{found:?}");
        // What a recipe has of it says the same.
        let again: Transform = read(serde_json::to_value(&transform).expect("is JSON")).expect("a transform");
        assert_eq!(again, transform);
    }

    #[test]
    fn positions_are_turned_and_then_moved() {
        let quarter = std::f64::consts::FRAC_PI_2;
        check(json!({ "yaw": quarter, "offset": [10.0, 0.0] }), [1.0, 2.0], [8.0, 1.0]);
        check(json!({ "offset": [1.0, -1.0] }), [1.0, 2.0], [2.0, 1.0]);
        check(json!({ "yaw": 2.0 * quarter }), [1.0, 2.0], [-1.0, -2.0]);
    }

    /// A quarter turn and twice the size: from (0, 0) and (1, 0) to (5, 5) and (5, 7).
    #[test]
    fn two_pairs_say_turn_size_and_place() {
        let pairs = json!({ "pairs": [[[0.0, 0.0], [5.0, 5.0]], [[1.0, 0.0], [5.0, 7.0]]] });
        check(pairs.clone(), [1.0, 0.0], [5.0, 7.0]);
        check(pairs, [0.0, 1.0], [3.0, 5.0]);
        check(json!({ "pairs": [[[2.0, 1.0], [0.0, 0.0]], [[2.0, 3.0], [0.0, 4.0]]] }), [3.0, 1.0], [2.0, 0.0]);
    }

    #[test]
    fn homographies_divide_by_the_third_number() {
        check(json!({ "homography": [[2.0, 0.0, 1.0], [0.0, 2.0, 0.0], [0.0, 1.0, 1.0]] }), [1.0, 1.0], [1.5, 1.0]);
    }

    #[test]
    fn what_is_no_transform_is_refused() {
        let one = "`transform` is one of `{ yaw, offset }`, `{ pairs }` and `{ homography }`";
        let pair = json!([[[0.0, 0.0], [1.0, 1.0]], [[1.0, 0.0], [2.0, 1.0]]]);
        assert_eq!(read(json!({})).expect_err("nothing"), one);
        assert_eq!(read(json!({ "yaw": 1.0, "pairs": pair })).expect_err("two"), one);
        let same = json!({ "pairs": [[[1.0, 1.0], [1.0, 1.0]], [[1.0, 1.0], [2.0, 1.0]]] });
        assert_eq!(read(same).expect_err("one position"), "`transform` needs two different positions");
        let flat = json!({ "homography": [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 1.0]] });
        assert_eq!(read(flat).expect_err("a line"), "`transform` is a matrix without an inverse");
    }
}
