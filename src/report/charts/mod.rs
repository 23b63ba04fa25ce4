//! Charts as SVG, to stand within an HTML page: text and lines take their colors from the page's style sheet.

mod boxes;
mod confusion;
mod curves;
mod dag;
mod svg;

pub use boxes::{BoxRow, box_plot};
pub use confusion::{Shade, confusion};
pub use curves::{Line, curves};
pub use dag::{StageBox, dag};
pub(super) use svg::{Anchor, Svg, short};
