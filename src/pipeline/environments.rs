//! Says of what must be made that it was made already, where only the environment was another one.

use crate::pipeline::stage::Stage;
use crate::store::{Difference, Recipe};

/// Returns the recipes of the same in the other environments that a stage knows of.
pub(crate) fn others(recipe: &Recipe, stage: &dyn Stage) -> Vec<Recipe> {
    let others = stage.environments().into_iter().filter(|other| *other != recipe.environment);
    others.map(|environment| Recipe { environment, ..recipe.clone() }).collect()
}

/// Says where it was made, and what helps.
pub(crate) fn told(here: &Recipe, there: &Recipe, stage: &dyn Stage) -> String {
    let value = |value: &Option<String>| value.clone().unwrap_or_else(|| "nothing".to_owned());
    let difference = |Difference { what, before, after }: &Difference| {
        let what = what.strip_prefix("environment.").unwrap_or(what);
        format!("{what} {} there, {} here", value(before), value(after))
    };
    let differences: Vec<String> = there.differences(here).iter().map(difference).collect();
    let advice = stage.sharing_advice().map_or_else(String::new, |advice| format!("; {advice}"));
    format!("it was made already, but elsewhere ({}): other machines give other bytes{advice}", differences.join(", "))
}
