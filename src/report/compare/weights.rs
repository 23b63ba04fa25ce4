//! Weights of networks: the norm of what has changed, by layer.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::domain::unet::{Array, Arrays};

/// How the arrays of two networks differ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WeightsChange {
    /// The layers that both have, by name.
    pub layers: Vec<LayerChange>,
    /// All of them together.
    pub total: LayerChange,
    /// Arrays that are of another shape, are gone or are new.
    pub reshaped: Vec<Reshaped>,
}

/// How much a layer has changed.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct LayerChange {
    /// Its name: that of its arrays without what they are of it, such as `weight`.
    pub layer: String,
    /// How many numbers it has.
    pub numbers: usize,
    /// How many of them differ.
    pub differing: usize,
    /// Euclidean norm before.
    pub norm: f64,
    /// Euclidean norm of the difference.
    pub change: f64,
    /// The latter by the former; `None` where everything was 0.
    pub relative: Option<f64>,
    /// The largest absolute difference of a number.
    pub largest: f64,
}

/// An array that cannot be held against another one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Reshaped {
    /// Its name.
    pub array: String,
    /// Its shape before; `None` if it is new.
    pub before: Option<Vec<usize>>,
    /// Its shape after; `None` if it is gone.
    pub after: Option<Vec<usize>>,
}

/// Sums over the numbers of a layer.
#[derive(Default)]
struct Sums {
    numbers: usize,
    differing: usize,
    squares: f64,
    changes: f64,
    largest: f64,
}

impl Sums {
    fn add(&mut self, before: &Array, after: &Array) {
        for (before, after) in before.values.iter().zip(&after.values) {
            let (before, after) = (f64::from(*before), f64::from(*after));
            let change = after - before;
            self.numbers += 1;
            self.differing += usize::from(change != 0.0);
            self.squares += before * before;
            self.changes += change * change;
            self.largest = self.largest.max(change.abs());
        }
    }

    fn of(self, layer: &str) -> LayerChange {
        let (norm, change) = (self.squares.sqrt(), self.changes.sqrt());
        LayerChange {
            layer: layer.to_owned(),
            numbers: self.numbers,
            differing: self.differing,
            norm,
            change,
            relative: (norm > 0.0).then(|| change / norm),
            largest: self.largest,
        }
    }
}

/// Compares the arrays of two networks.
#[must_use]
pub fn compare(before: &Arrays, after: &Arrays) -> WeightsChange {
    let (mut layers, mut total, mut reshaped) = (BTreeMap::<&str, Sums>::new(), Sums::default(), Vec::new());
    let mut names: Vec<&String> = before.keys().chain(after.keys()).collect();
    names.sort_unstable();
    names.dedup();
    for name in names {
        match (before.get(name), after.get(name)) {
            (Some(old), Some(new)) if old.shape == new.shape => {
                let layer = name.rsplit_once('.').map_or(name.as_str(), |(layer, _)| layer);
                layers.entry(layer).or_default().add(old, new);
                total.add(old, new);
            }
            (old, new) => {
                let shape = |array: Option<&Array>| array.map(|array| array.shape.clone());
                reshaped.push(Reshaped { array: name.clone(), before: shape(old), after: shape(new) });
            }
        }
    }
    let layers = layers.into_iter().map(|(layer, sums)| sums.of(layer)).collect();
    WeightsChange { layers, total: total.of("all"), reshaped }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrays(entries: &[(&str, &[usize], &[f32])]) -> Arrays {
        let array = |shape: &[usize], values: &[f32]| Array { shape: shape.to_vec(), values: values.to_vec() };
        entries.iter().map(|(name, shape, values)| ((*name).to_owned(), array(shape, values))).collect()
    }

    #[test]
    fn norms_are_those_of_a_layer_with_all_its_arrays() {
        // Before: √(3² + 4² + 0²) = 5. Change: (3, 0) and (4): 5, all of it.
        let before = arrays(&[("a.weight", &[2], &[3.0, 4.0]), ("a.bias", &[1], &[0.0]), ("b.bias", &[1], &[0.0])]);
        let after = arrays(&[("a.weight", &[2], &[6.0, 4.0]), ("a.bias", &[1], &[-4.0]), ("b.bias", &[1], &[0.0])]);
        let change = compare(&before, &after);
        let [a, b] = change.layers.as_slice() else { panic!("{change:?}") };
        assert_eq!((a.layer.as_str(), a.numbers, a.differing), ("a", 3, 2));
        assert_eq!((a.norm, a.change, a.relative, a.largest), (5.0, 5.0, Some(1.0), 4.0));
        assert_eq!((b.layer.as_str(), b.change, b.relative), ("b", 0.0, None));
        assert_eq!((change.total.numbers, change.total.norm, change.total.change), (4, 5.0, 5.0));
        assert_eq!(change.reshaped, []);
    }

    #[test]
    fn what_cannot_be_subtracted_is_named() {
        let before = arrays(&[("a.weight", &[1, 2], &[1.0, 2.0]), ("old", &[1], &[1.0])]);
        let after = arrays(&[("a.weight", &[2, 1], &[1.0, 2.0]), ("new", &[], &[1.0])]);
        let change = compare(&before, &after);
        let reshaped = |array: &str, before: Option<&[usize]>, after: Option<&[usize]>| Reshaped {
            array: array.to_owned(),
            before: before.map(<[usize]>::to_vec),
            after: after.map(<[usize]>::to_vec),
        };
        let expected = [
            reshaped("a.weight", Some(&[1, 2]), Some(&[2, 1])),
            reshaped("new", None, Some(&[])),
            reshaped("old", Some(&[1]), None),
        ];
        assert_eq!(change.reshaped, expected);
        assert_eq!(change.total.numbers, 0);
    }
}
