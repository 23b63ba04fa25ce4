//! A page with what differs between two artifacts: words, and pictures beside each other.

use maud::{DOCTYPE, PreEscaped, html};

use super::figure::figure;
use super::page::STYLE;
use crate::report::compare::Section;
use crate::report::picture::Scale;

/// Returns the page.
#[must_use]
pub fn comparison(title: &str, about: &[String], sections: &[Section]) -> String {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) " · trodden" }
                style { (PreEscaped(STYLE)) }
            }
            body {
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
                footer { "Written by trodden " (env!("CARGO_PKG_VERSION")) ". This page needs nothing but itself." }
            }
        }
    }
    .into_string()
}
