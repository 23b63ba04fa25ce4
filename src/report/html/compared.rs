//! A page with what differs between two artifacts: words, and pictures beside each other.

use maud::html;

use super::document::document;
use super::figure::figure;
use crate::report::compare::Section;
use crate::report::picture::Scale;

/// Returns the page.
#[must_use]
pub fn comparison(title: &str, about: &[String], sections: &[Section]) -> String {
    let content = html! {
        header {
            p.kicker { "trodden · what differs" }
            h1 { (title) }
            @for line in about { p.muted { (line) } }
        }
        main {
            @for section in sections {
                section {
                    h2 { (section.title) }
                    div.figures {
                        @for (caption, picture) in &section.pictures {
                            (figure(picture, Scale::Linear, caption, ""))
                        }
                    }
                    pre { code { (section.lines.join("\n")) } }
                }
            }
        }
    };
    document(title, env!("CARGO_PKG_VERSION"), &content)
}
