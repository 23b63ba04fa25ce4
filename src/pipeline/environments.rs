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
    let differences: Vec<String> = there.differences(here).iter().map(Difference::there_and_here).collect();
    let advice = stage.sharing_advice().map_or_else(String::new, |advice| format!("; {advice}"));
    format!("it was made already, but elsewhere ({}): other machines give other bytes{advice}", differences.join(", "))
}
