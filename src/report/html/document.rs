//! The frame of every page: head and style before what it shows, and a foot after it.

use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = include_str!("style.css");

/// Returns the page with a title, written by a version of this program.
#[must_use]
pub fn document(title: &str, version: &str, content: &Markup) -> String {
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
                (content)
                footer { "Written by trodden " (version) ". This page needs nothing but itself." }
            }
        }
    }
    .into_string()
}
