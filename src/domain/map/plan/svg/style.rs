//! What a shape is painted with: attributes, style sheets and what is inherited.

use roxmltree::Node;
use simplecss::{AttributeOperator, DeclarationTokenizer, Element, PseudoClass, StyleSheet};
use svgtypes::Paint;

use super::length::length;

/// How shapes are painted, as it is inherited.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Style {
    /// Color of what is surrounded, `#rrggbb`; `None` if it is not painted.
    pub fill: Option<String>,
    /// Color of the line.
    pub stroke: Option<String>,
    /// Width of the line in user units.
    pub width: f64,
    /// Whether the odd rule says what is surrounded.
    pub odd: bool,
    /// Whether it is seen.
    pub visible: bool,
    /// Whether it is drawn at all.
    pub displayed: bool,
}

impl Default for Style {
    fn default() -> Self {
        Self { fill: Some("#000000".to_owned()), stroke: None, width: 1.0, odd: false, visible: true, displayed: true }
    }
}

impl Style {
    /// Returns the style of an element within one of this style: attributes count least, then what style sheets say, then its own
    /// style.
    pub fn of(&self, node: Node<'_, '_>, sheet: &StyleSheet<'_>) -> Self {
        let mut style = self.clone();
        for name in ["fill", "stroke", "stroke-width", "fill-rule", "visibility", "display"] {
            if let Some(value) = node.attribute(name) {
                style.set(self, name, value.trim());
            }
        }
        let element = XmlElement(node);
        // Rules are in the order of how much they count.
        let rules = sheet.rules.iter().filter(|rule| rule.selector.matches(&element));
        let own = DeclarationTokenizer::from(node.attribute("style").unwrap_or_default());
        for declaration in rules.flat_map(|rule| &rule.declarations).copied().chain(own) {
            style.set(self, declaration.name, declaration.value.trim());
        }
        style
    }

    fn set(&mut self, around: &Self, name: &str, value: &str) {
        let inherits = value == "inherit";
        match name {
            "fill" => self.fill = if inherits { around.fill.clone() } else { painted(value) },
            "stroke" => self.stroke = if inherits { around.stroke.clone() } else { painted(value) },
            "stroke-width" => self.width = length(value).unwrap_or(around.width),
            "fill-rule" => self.odd = if inherits { around.odd } else { value == "evenodd" },
            "visibility" => self.visible = if inherits { around.visible } else { value == "visible" },
            "display" => self.displayed = value != "none",
            _ => {}
        }
    }
}

/// Returns the color of a paint, `#rrggbb`, or `url` for what is no color; `None` if it paints nothing.
fn painted(value: &str) -> Option<String> {
    match Paint::from_str(value) {
        Ok(Paint::None) => None,
        Ok(Paint::Color(color)) if color.alpha == 0 => None,
        Ok(Paint::Color(color)) => Some(format!("#{:02x}{:02x}{:02x}", color.red, color.green, color.blue)),
        Ok(Paint::CurrentColor) => Some("#000000".to_owned()),
        Ok(_) => Some("url".to_owned()),
        Err(_) => Some(value.to_owned()),
    }
}

/// An element, as selectors of style sheets ask for it.
struct XmlElement<'a, 'i>(Node<'a, 'i>);

impl Element for XmlElement<'_, '_> {
    fn parent_element(&self) -> Option<Self> {
        self.0.parent_element().map(XmlElement)
    }

    fn prev_sibling_element(&self) -> Option<Self> {
        self.0.prev_sibling_element().map(XmlElement)
    }

    fn has_local_name(&self, name: &str) -> bool {
        self.0.tag_name().name() == name
    }

    fn attribute_matches(&self, local_name: &str, operator: AttributeOperator<'_>) -> bool {
        self.0.attribute(local_name).is_some_and(|value| operator.matches(value))
    }

    fn pseudo_class_matches(&self, class: PseudoClass<'_>) -> bool {
        matches!(class, PseudoClass::FirstChild) && self.prev_sibling_element().is_none()
    }
}
