//! Describes the workers of a job to Kubernetes: one Indexed Job of as many workers as its widest wave has units.
//!
//! Kubernetes lets no Job wait for another, so the workers wait themselves: each takes one unit after the other until all
//! have ended, wave by wave, as those do that somebody starts by hand. One that is lost is started again.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::job::Job;
use super::slurm::Site;

/// The most workers, where the site does not say.
const MOST: usize = 100;
/// How often each of them may be lost.
const LOSSES: usize = 6;
/// The image of a worker, where the site does not name one.
const IMAGE: &str = "trodden:latest";

/// Returns the manifest of the Job that does a job.
#[must_use]
pub fn manifest(job: &Job, site: &Site, address: &str) -> Value {
    let mut waves: BTreeMap<usize, usize> = BTreeMap::new();
    job.units.iter().for_each(|unit| *waves.entry(unit.wave).or_default() += 1);
    let workers = waves.values().copied().max().unwrap_or(1).min(site.array.unwrap_or(MOST)).max(1);
    let name = format!("trodden-{}", job.id.to_lowercase());
    let mut resources = serde_json::Map::new();
    resources.extend(site.cpus.map(|cpus| ("cpu".to_owned(), json!(cpus.to_string()))));
    resources.extend(site.memory.map(|mib| ("memory".to_owned(), json!(format!("{mib}Mi")))));
    let gpu = job.units.iter().any(|unit| unit.gpu);
    let gpus = site.gpus.as_deref().filter(|_| gpu);
    resources.extend(gpus.map(|gpus| ("nvidia.com/gpu".to_owned(), json!(gpus))));
    let mut args: Vec<String> =
        ["worker", "--remote", address, "--run", &job.id, "--scratch", "/scratch"].map(str::to_owned).into();
    args.extend(site.cpus.into_iter().flat_map(|cpus| ["--jobs".to_owned(), cpus.to_string()]));
    // A tenth of the memory is for what no node asks for.
    let gib = site.memory.map(|mib| mib as f64 / 1024.0 * 0.9);
    args.extend(gib.into_iter().flat_map(|gib| ["--memory".to_owned(), format!("{gib:.3}")]));
    let mut container = json!({
        "name": "worker",
        "image": site.image.as_deref().unwrap_or(IMAGE),
        "args": args,
        "resources": { "requests": resources, "limits": resources },
        "volumeMounts": [{ "name": "scratch", "mountPath": "/scratch" }],
    });
    if let Some(secret) = &site.secret {
        container["envFrom"] = json!([{ "secretRef": { "name": secret } }]);
    }
    let mut pod = json!({
        "restartPolicy": "Never",
        "containers": [container],
        "volumes": [{ "name": "scratch", "emptyDir": {} }],
    });
    if let Some(account) = &site.service_account {
        pod["serviceAccountName"] = json!(account);
    }
    let mut metadata = json!({ "name": name, "labels": { "app": "trodden", "trodden/run": job.id } });
    if let Some(namespace) = &site.namespace {
        metadata["namespace"] = json!(namespace);
    }
    json!({
        "apiVersion": "batch/v1",
        "kind": "Job",
        "metadata": metadata,
        "spec": {
            "completionMode": "Indexed",
            "completions": workers,
            "parallelism": workers,
            "backoffLimit": workers * LOSSES,
            "template": { "metadata": { "labels": { "app": "trodden" } }, "spec": pod },
        },
    })
}
