use super::super::testing::{node, record, run, store};
use super::super::{Artifact, Digest, LatestEntry, Role, Run, RunNode, RunStatus};
use super::*;

/// Whatever its age.
const ALL: Collect = Collect { dry_run: false, older_than: Duration::ZERO, keep_last: 0 };

fn epoch(name: &str, artifact: &Artifact, key: Key) -> RunNode {
    RunNode { role: Role::Step, ..node(name, artifact, key) }
}

/// Makes a node's artifact and recipe in another process's place: its session ends with this function.
fn made(root: &Path, name: &str) -> (Artifact, Key) {
    let store = Store::open(root).expect("opens");
    let record = record(&store, name);
    let key = record.recipe.key();
    store.remember(&key, &record).expect("remembers");
    (record.artifact, key)
}

fn finish(root: &Path, run: &Run) {
    Store::open(root).expect("opens").write_run(run).expect("writes");
}

/// Makes a file look as if it had been written some days ago.
fn age(path: &Path, days: u32) {
    let file = fs::File::open(path).expect("opens");
    file.set_modified(SystemTime::now() - DAY * days).expect("sets");
}

#[test]
fn only_what_counting_runs_reach_stays() {
    let (folder, store) = store();
    drop(store);
    let root = folder.path();
    let names = ["old", "kept", "older-failed", "new", "failed", "other"];
    let made: Vec<_> = names.iter().map(|name| made(root, name)).collect();
    for (hour, (name, (artifact, key))) in names.iter().zip(&made).enumerate() {
        let mut record = run(name, hour as u32, vec![node(name, artifact, *key)]);
        record.keep = *name == "kept";
        if name.ends_with("failed") {
            record.status = RunStatus::Failed;
        }
        if *name == "other" {
            record.pipeline = "other".to_owned();
        }
        finish(root, &record);
    }
    let store = Store::open_existing(root).expect("opens");
    let plan = store.collect(&Collect { dry_run: true, ..ALL }).expect("plans");
    assert_eq!((plan.objects.files, plan.recipes.files), (2, 2));
    assert!(made.iter().all(|(artifact, _)| store.complete(artifact)), "a plan frees nothing");
    assert_eq!(store.collect(&ALL).expect("collects"), plan);
    for (name, (artifact, key)) in names.iter().zip(&made) {
        let stays = ["kept", "new", "failed", "other"].contains(name);
        assert_eq!(store.complete(artifact), stays, "{name}");
        assert_eq!(store.recall(key).expect("reads").is_some(), stays, "{name}");
    }
    assert_eq!(plan.kept_runs, ["other", "failed", "new", "kept"]);
    assert_eq!(store.collect(&ALL).expect("collects").files(), 0);
}

#[test]
fn what_is_young_stays_although_no_run_reaches_it() {
    let (folder, store) = store();
    drop(store);
    let root = folder.path();
    let [old, young, later] = ["old", "young", "later"].map(|name| made(root, name));
    let store = Store::open_existing(root).expect("opens");
    for (artifact, key) in [&old, &later] {
        age(&store.path_of(&artifact.digest), 2);
        age(&store.recipe_path(key), 2);
    }
    // Its bytes are old, but not that they came out of this recipe.
    age(&store.recipe_path(&later.1), 0);
    let collected = store.collect(&Collect::default()).expect("collects");
    assert_eq!((collected.objects.files, collected.recipes.files), (1, 1));
    assert_eq!(collected.young.files, 4);
    assert!(!store.complete(&old.0) && store.complete(&young.0) && store.complete(&later.0));
    let two_days = Collect { older_than: DAY * 3, ..ALL };
    assert_eq!(store.collect(&two_days).expect("collects").files(), 0);
    assert_eq!(store.collect(&ALL).expect("collects").objects.files, 2);
}

#[test]
fn a_killed_run_keeps_what_it_had_finished() {
    let (folder, store) = store();
    drop(store);
    let root = folder.path();
    let [before, recorded, noted] = ["before", "recorded", "noted"].map(|name| made(root, name));
    finish(root, &run("before", 1, vec![node("a", &before.0, before.1)]));
    let store = Store::open(root).expect("opens");
    let mut killed = run("killed", 2, vec![node("a", &recorded.0, recorded.1)]);
    let journal = store.begin_run(&mut killed, 2).expect("begins");
    journal.note(1, &noted.1).expect("writes");
    let stray = store.put("", b"nobody's").expect("puts");
    drop(store);
    let store = Store::open_existing(root).expect("opens");
    assert_eq!(store.collect(&ALL).expect("collects").objects.files, 1);
    assert!(!store.has(&stray.digest));
    assert!([before, recorded, noted].iter().all(|(artifact, _)| store.complete(artifact)));
}

#[test]
fn a_dry_run_writes_nothing() {
    let (folder, store) = store();
    drop(store);
    made(folder.path(), "a");
    fs::remove_dir_all(folder.path().join("locks")).expect("removes");
    fs::write(folder.path().join("locks"), "a file in the place of the folder").expect("writes");
    let store = Store::open_existing(folder.path()).expect("opens");
    assert_eq!(store.collect(&Collect { dry_run: true, ..ALL }).expect("plans").objects.files, 1);
}

#[test]
fn the_cache_goes() {
    let (folder, store) = store();
    let cache = folder.path().join("cache/report");
    fs::create_dir_all(&cache).expect("creates");
    fs::write(cache.join("picture"), b"drawn").expect("writes");
    let plan = store.collect(&Collect { dry_run: true, ..ALL }).expect("plans");
    assert_eq!(plan.cache, Freed { files: 1, bytes: 5 });
    assert_eq!(store.collect(&Collect::default()).expect("collects").bytes(), 5);
    assert_eq!(store.collect(&ALL).expect("collects").files(), 0);
}

#[test]
fn of_epochs_of_a_finished_run_only_the_last_stays_but_all_recipes() {
    for status in [RunStatus::Finished, RunStatus::Interrupted, RunStatus::Failed] {
        let (folder, store) = store();
        drop(store);
        let root = folder.path();
        let epochs: Vec<_> = (1..=11).map(|number| (number, made(root, &format!("epoch {number}")))).collect();
        let mut nodes: Vec<_> = epochs
            .iter()
            .map(|(number, (artifact, key))| epoch(&format!("model/epoch-{number:02}"), artifact, *key))
            .collect();
        // The order in the record does not matter.
        nodes.reverse();
        finish(root, &Run { status, ..run("a", 0, nodes) });
        let store = Store::open_existing(root).expect("opens");
        let finished = status == RunStatus::Finished;
        assert_eq!(store.collect(&ALL).expect("collects").objects.files, if finished { 10 } else { 0 });
        for (number, (artifact, key)) in &epochs {
            assert_eq!(store.complete(artifact), *number == 11 || !finished, "{number}");
            assert!(store.recall(key).expect("reads").is_some(), "{number}");
        }
        assert!(store.verify(&|_, _| ()).expect("verifies").missing.is_empty());
    }
}

#[test]
fn what_a_living_process_wrote_or_recalled_stays() {
    let (folder, store) = store();
    let root = folder.path();
    let recalled = made(root, "recalled");
    let forgotten = made(root, "forgotten");
    assert!(store.recall(&recalled.1).expect("reads").is_some());
    let bare = store.put("", b"no recipe yet").expect("puts");
    // Found there, not written: it must stay all the same.
    let found = Store::open(root).expect("opens").put("", b"found").expect("puts");
    store.put("", b"found").expect("puts");
    let mut writer = store.create().expect("creates");
    std::io::Write::write_all(&mut writer, b"half of").expect("writes");

    let collector = Store::open_existing(root).expect("opens");
    let collected = collector.collect(&ALL).expect("collects");
    assert_eq!((collected.objects.files, collected.temporary.files), (1, 0));
    assert!(store.complete(&recalled.0) && store.has(&bare.digest) && store.has(&found.digest));
    assert!(!store.complete(&forgotten.0));
    let written = writer.finish("").expect("the file of a living process is still there");
    assert_eq!(store.read(&written.digest).expect("reads"), b"half of");

    drop(store);
    assert_eq!(collector.collect(&ALL).expect("collects").objects.files, 4);
}

#[test]
fn a_damaged_record_of_a_run_frees_nothing_before_it_is_set_aside_and_a_day_after() {
    let (folder, store) = store();
    drop(store);
    let root = folder.path();
    let (artifact, key) = made(root, "a");
    finish(root, &run("a", 0, vec![node("a", &artifact, key)]));
    let store = Store::open_existing(root).expect("opens");
    let path = store.run_dir("a").join("run.json");
    let text = fs::read_to_string(&path).expect("reads");
    // One flipped bit in what was not even needed.
    fs::write(&path, text.replace("0.1.0", "0.1.1")).expect("writes");
    age(&path, 9);
    for lose_the_list in [false, true] {
        if lose_the_list {
            fs::remove_file(root.join("runs/index.jsonl")).expect("removes");
        }
        let error = store.collect(&ALL).expect_err("the run may reach anything");
        assert!(error.to_string().contains("run.json") && error.is_damage(), "{error}");
        assert!(store.complete(&artifact));
    }
    let report = store.verify(&|_, _| ()).expect("verifies");
    let aside = report.damaged[0].aside.clone().expect("was moved");
    assert_eq!(store.collect(&ALL).expect("collects").objects.files, 0);
    assert!(store.complete(&artifact) && aside.exists());
    age(&aside, 2);
    let collected = store.collect(&ALL).expect("collects");
    assert_eq!((collected.objects.files, collected.damaged.files), (1, 1));
}

#[test]
fn leftovers_of_dead_processes_and_dangling_links_go() {
    let (folder, store) = store();
    let root = folder.path();
    let (artifact, _) = made(root, "a");
    store
        .link_latest("homes", &[LatestEntry { node: "a".to_owned(), artifact, extension: "bin".into() }])
        .expect("links");
    drop(store);
    finish(root, &run("a", 1, Vec::new()));
    for (path, text) in [
        ("temp/1-1/lock", ""),
        ("temp/1-1/0", "half an object"),
        ("runs/killed/report.html", "<p>"),
        ("runs/a/.report-1", "<"),
    ] {
        fs::create_dir_all(root.join(path).parent().expect("has one")).expect("creates");
        fs::write(root.join(path), text).expect("writes");
    }
    let lock = root.join("locks").join(Digest::of(b"").to_hex());
    fs::write(&lock, "").expect("writes");
    let own = root.join("latest/homes/mine");
    std::os::unix::fs::symlink("/nowhere", &own).expect("links");

    let collected = Store::open_existing(root).expect("opens").collect(&ALL).expect("collects");
    assert_eq!((collected.temporary, collected.links), (Freed { files: 3, bytes: 15 }, 1));
    assert_eq!(collected.runs, Freed { files: 1, bytes: 3 });
    assert!(!root.join("temp/1-1").exists() && !root.join("runs/killed").exists() && !lock.exists());
    assert!(own.is_symlink() && !root.join("latest/homes/a.bin").is_symlink());
}
