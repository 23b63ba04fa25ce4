//! A page on which a map can be looked at: offline, in any browser of our days.
//!
//! A [`Scene`] is what lies on one map: layers of values or classes, directions of flow, lines, episodes to play. It becomes
//! a whole page ([`page()`]) or a part of one ([`embedded`], once [`assets`] is in the page).
//!
//! # How it works
//!
//! Everything travels in the page: a description as JSON, and one blob of numbers, deflated and in base64, that the browser
//! unpacks by itself (`DecompressionStream`; where that or JavaScript is missing, the page says so and names the other
//! files). Numbers are as fine as the eye and a reader need: values on a square-root scale of 4,095 steps, so that a tenth
//! of a percent of the largest value is still told to within a hundredth of itself; counts up to 65,535 as they are;
//! directions of flow in blocks of cells; tracks in centimeters, about five times a second.
//!
//! The script draws each layer once, one pixel a cell, and lays that picture under the window with one scaled copy, so what
//! it costs to move and zoom hangs on the window and not on the number of cells. Arrows are averaged over blocks that
//! are never narrower than an arrow. A view in a closed `details` unpacks nothing before it is opened.
//!
//! Colors are those of the PNG figures. Names of maps and nodes are text, in the JSON with `<`, `>` and `&` escaped and in the
//! page only ever set as text, so no name can become markup; a page of its own also forbids by its policy everything that is
//! not in it. The same scene gives the same bytes.
//!
//! Not for: editing, printing (figures are), or maps side by side.

mod episodes;
mod flow;
mod pack;
mod page;
mod scene;

pub use episodes::Episode;
pub use page::{assets, embedded, page};
pub use scene::Scene;
