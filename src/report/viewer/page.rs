//! The page, or the part of one, that shows a scene.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::pack::pack;
use super::scene::Scene;

const STYLE: &str = include_str!("viewer.css");
/// One function after the other, and at last what calls them.
const SCRIPT: &str = concat!(
    "(() => {\n\"use strict\";\n",
    include_str!("script/numbers.js"),
    include_str!("script/data.js"),
    include_str!("script/paint.js"),
    include_str!("script/overlay.js"),
    include_str!("script/panel.js"),
    include_str!("script/player.js"),
    include_str!("script/view.js"),
    "})();\n"
);
/// Nothing but what is in the page.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'";

/// Returns a page of its own; `besides` are the files where those find the same who cannot see it.
#[must_use]
pub fn page(scene: &Scene, besides: &str) -> String {
    html! {
        (DOCTYPE)
        html.tv-page lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (scene.title) " · trodden" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                (view(scene, false, besides))
                script { (PreEscaped(SCRIPT)) }
            }
        }
    }
    .into_string()
}

/// Returns a view to be put into a page that has the [`assets`] too.
#[must_use]
pub fn embedded(scene: &Scene, besides: &str) -> Markup {
    view(scene, true, besides)
}

/// Returns what a page with [`embedded`] views needs once, at its end.
#[must_use]
pub fn assets() -> Markup {
    html! {
        style { (PreEscaped(STYLE)) }
        script { (PreEscaped(SCRIPT)) }
    }
}

fn view(scene: &Scene, embedded: bool, besides: &str) -> Markup {
    let packed = pack(scene);
    html! {
        div.trodden-view data-embedded[embedded] data-besides=(besides) {
            noscript { p.tv-trouble { "This view needs JavaScript. " (besides) } }
            script type="application/json" { (PreEscaped(packed.about)) }
            script type="text/plain" { (PreEscaped(packed.numbers)) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::colors::{self, hex};

    /// In a light page the map looks as the figures do.
    #[test]
    fn the_style_has_the_colors_of_the_figures() {
        let shared = [
            ("free", colors::FREE),
            ("wall", colors::WALL),
            ("empty", colors::EMPTY),
            ("person", colors::PEDESTRIAN),
            ("robot", colors::ROBOT),
        ];
        for (name, color) in shared {
            assert!(STYLE.contains(&format!("--tv-{name}: {};", hex(color))), "{name}");
        }
    }

    #[test]
    fn nothing_of_a_view_could_be_loaded_from_elsewhere() {
        for text in [STYLE, SCRIPT] {
            for outside in ["http", "url(", "@import", "src", "href", "innerHTML", "</"] {
                assert!(!text.contains(outside), "{outside}");
            }
        }
    }
}
