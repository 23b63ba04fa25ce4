//! Holds the store to its promises from outside: what is read is what was written, whoever writes beside it, is killed, or
//! fills the disk.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use proptest::prelude::*;
use tempfile::TempDir;
use trodden::store::{Artifact, Collect, Digest, Recipe, Record, Remembered, Store, StoreError};

use super::needs::Need;

/// Names the store that a child process of a test is to use, and what it is to do there.
const CHILD_STORE: &str = "TRODDEN_TEST_STORE";
const CHILD_TASK: &str = "TRODDEN_TEST_TASK";

fn store() -> (TempDir, Store) {
    let folder = tempfile::tempdir().expect("creates");
    let store = Store::open(folder.path()).expect("opens");
    (folder, store)
}

fn recipe(name: &str) -> Recipe {
    Recipe {
        stage: name.to_owned(),
        part: None,
        version: 1,
        kind: "Labels".to_owned(),
        format: 1,
        parameters: serde_json::json!({ "classes": 3 }),
        seed: None,
        environment: BTreeMap::new(),
        inputs: BTreeMap::new(),
    }
}

/// Returns bytes that depend on a number alone.
fn content(number: usize) -> Vec<u8> {
    (0..4000 + number).map(|position| (position * 7 + number * 13) as u8).collect()
}

/// Returns the paths of all files below a folder.
fn files(folder: &Path) -> Vec<std::path::PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("lists") {
        let path = entry.expect("lists").path();
        if path.is_dir() { found.extend(files(&path)) } else { found.push(path) }
    }
    found
}

/// Runs [`child`] in a process of its own, through a command such as `unshare` if one is given.
fn spawn(through: &[&str], root: &Path, task: &str) -> Child {
    // The first segment is the name of the test binary.
    let module = module_path!().split_once("::").map_or("", |(_, module)| module);
    let name = format!("{module}::child");
    let test = std::env::current_exe().expect("is running");
    let mut words = through.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
    words.extend([test.to_string_lossy().into_owned(), "--exact".to_owned(), name, "--nocapture".to_owned()]);
    Command::new(&words[0])
        .args(&words[1..])
        .env(CHILD_STORE, root)
        .env(CHILD_TASK, task)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("starts")
}

/// Does what another test asks of it in a process of its own; on its own it has nothing to do.
#[test]
fn child() {
    let (Some(root), Ok(task)) = (std::env::var_os(CHILD_STORE), std::env::var(CHILD_TASK)) else { return };
    let root = Path::new(&root);
    match task.as_str() {
        "write" => write_everything(&Store::open(root).expect("opens")),
        "lock" => {
            let store = Store::open(root).expect("opens");
            let _lock = store.try_lock(&recipe("locked").key()).expect("locks").expect("is free");
            fs::write(root.join(".locked"), "").expect("writes");
            std::thread::sleep(Duration::from_secs(60));
        }
        "fill" => println!("outcome: {}", fill(root)),
        other => panic!("no task `{other}`"),
    }
}

/// Stores sixty objects with their recipes, some of the same content.
fn write_everything(store: &Store) {
    for number in 0..60 {
        let mut writer = store.create().expect("creates");
        writer.write_all(&content(number % 40)).expect("writes");
        let artifact = Artifact::single(writer.finish("").expect("ends"));
        let recipe = recipe(&number.to_string());
        let key = recipe.key();
        let remembered = store.remember(&key, &Record { recipe, artifact, making: None }).expect("remembers");
        assert!(!matches!(remembered, Remembered::Other { .. }));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn what_is_read_is_what_was_written(parts in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..3000), 0..6)) {
        let (_folder, store) = store();
        let whole = parts.concat();
        let put = store.put("name", &whole).expect("puts");
        prop_assert_eq!((put.digest, put.bytes), (Digest::of(&whole), whole.len() as u64));
        prop_assert_eq!(store.read(&put.digest).expect("reads"), whole.clone());
        let mut writer = store.create().expect("creates");
        for part in &parts {
            writer.write_all(part).expect("writes");
        }
        prop_assert_eq!(writer.finish("name").expect("ends"), put.clone());
        let mut read = Vec::new();
        std::io::Read::read_to_end(&mut store.open_object(&put.digest).expect("opens"), &mut read).expect("reads");
        prop_assert_eq!(read, whole);
        prop_assert!(store.complete(&Artifact::single(put)));
    }
}

#[test]
fn objects_are_read_only_and_where_the_page_says() {
    let (folder, store) = store();
    let file = store.put("", b"a").expect("puts");
    let hex = file.digest.to_hex();
    let path = folder.path().join("objects").join(&hex[..2]).join(&hex[2..]);
    assert_eq!(store.path_of(&file.digest), path);
    assert_eq!(path.metadata().expect("is there").permissions().mode() & 0o222, 0);
}

#[test]
fn a_bundle_does_not_depend_on_the_order_of_its_files() {
    let (_folder, store) = store();
    let [a, b] = ["a", "b"].map(|name| store.put(name, name.as_bytes()).expect("puts"));
    let bundle = store.bundle("Checkpoint", 1, vec![b.clone(), a.clone()]).expect("puts");
    assert_eq!(bundle, store.bundle("Checkpoint", 1, vec![a.clone(), b.clone()]).expect("puts"));
    assert_ne!(bundle.digest, store.bundle("Checkpoint", 2, vec![a.clone(), b.clone()]).expect("puts").digest);
    assert!(bundle.is_bundle() && !Artifact::single(a.clone()).is_bundle());
    assert_eq!(bundle.objects().collect::<Vec<_>>(), [a.digest, b.digest, bundle.digest]);
    assert_eq!((bundle.file("b"), bundle.file("c"), bundle.bytes()), (Some(&b), None, 2));
    assert!(store.complete(&bundle));
    fs::remove_file(store.path_of(&bundle.digest)).expect("removes");
    assert!(!store.complete(&bundle));
    let twice = store.bundle("Checkpoint", 1, vec![a.clone(), a.clone()]);
    assert!(matches!(twice, Err(StoreError::DuplicatePart { .. })));
    let outside = trodden::store::FileRef { name: "../a".to_owned(), ..a };
    assert!(matches!(store.bundle("Checkpoint", 1, vec![outside]), Err(StoreError::Name { .. })));
}

#[test]
fn many_writers_agree() {
    let (folder, store) = store();
    let children: Vec<Child> = (0..2).map(|_| spawn(&[], folder.path(), "write")).collect();
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| write_everything(&store));
        }
    });
    for child in children {
        let output = child.wait_with_output().expect("ends");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    let report = store.verify(&|_, _| ()).expect("verifies");
    assert!(report.is_clean(), "{report:?}");
    assert_eq!((report.objects, report.recipes), (40, 60));
}

#[test]
fn a_killed_writer_leaves_no_half_object() {
    let folder = tempfile::tempdir().expect("creates");
    for number in 0..12 {
        let mut child = spawn(&[], folder.path(), "write");
        // Between starting up and the last object, at another moment each time.
        std::thread::sleep(Duration::from_millis(3 + number * 7));
        child.kill().expect("kills");
        child.wait().expect("ends");
    }
    let store = Store::open(folder.path()).expect("opens");
    let report = store.verify(&|_, _| ()).expect("verifies");
    assert!(report.is_clean(), "{report:?}");
    let sessions = fs::read_dir(folder.path().join("temp")).expect("lists").count();
    assert_eq!(sessions, 1, "opening removes what the dead were writing");
    write_everything(&store);
    let report = store.verify(&|_, _| ()).expect("verifies");
    assert_eq!((report.objects, report.recipes, report.is_clean()), (40, 60, true));
}

#[test]
fn one_has_the_lock_of_a_key() {
    let (_folder, store) = store();
    let (key, other) = (recipe("a").key(), recipe("b").key());
    let lock = store.try_lock(&key).expect("locks").expect("is free");
    let elsewhere = std::thread::scope(|scope| scope.spawn(|| store.try_lock(&key).expect("works").is_some()).join());
    assert!(!elsewhere.expect("ends"), "threads exclude each other");
    assert!(store.try_lock(&other).expect("works").is_some());
    drop(lock);
    assert!(store.try_lock(&key).expect("works").is_some());
}

#[test]
fn of_many_who_want_a_lock_one_is_inside() {
    let (_folder, store) = store();
    let key = recipe("a").key();
    let inside = AtomicUsize::new(0);
    let entered = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                for _ in 0..50 {
                    // Whoever goes on trying gets it in the end.
                    let lock = loop {
                        match store.try_lock(&key).expect("works") {
                            Some(lock) => break lock,
                            None => std::thread::yield_now(),
                        }
                    };
                    assert_eq!(inside.fetch_add(1, Ordering::SeqCst), 0);
                    entered.fetch_add(1, Ordering::SeqCst);
                    inside.fetch_sub(1, Ordering::SeqCst);
                    drop(lock);
                }
            });
        }
    });
    assert_eq!(entered.into_inner(), 8 * 50);
    assert!(store.try_lock(&key).expect("works").is_some(), "whoever is alone gets it");
}

#[test]
fn a_lock_dies_with_its_process() {
    let (folder, store) = store();
    let key = recipe("locked").key();
    let mut child = spawn(&[], folder.path(), "lock");
    let deadline = Instant::now() + Duration::from_secs(30);
    while !folder.path().join(".locked").exists() {
        assert!(Instant::now() < deadline, "the child did not get its lock");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(store.try_lock(&key).expect("works").is_none(), "another process has it");
    child.kill().expect("kills");
    child.wait().expect("ends");
    assert!(store.try_lock(&key).expect("works").is_some());
}

/// Opens and fills a store until that fails; says how, and checks that nothing is damaged.
fn fill(root: &Path) -> String {
    let store = match Store::open(root) {
        Ok(store) => store,
        Err(error) => return format!("{error}; help: {}", error.help().unwrap_or_default()),
    };
    for number in 0..10_000 {
        let mut writer = match store.create() {
            Ok(writer) => writer,
            Err(error) => return format!("{error}; help: {}", error.help().unwrap_or_default()),
        };
        let written = writer.write_all(&content(number));
        let finished = written
            .map_err(|error| error.to_string())
            .and_then(|()| writer.finish("").map_err(|error| error.to_string()));
        if let Err(error) = finished {
            let report = store.verify(&|_, _| ()).expect("verifies");
            let stale = files(&root.join("temp"))
                .iter()
                .filter(|path| !path.ends_with("lock") && !path.ends_with("pins"))
                .count();
            let put = store.put("", &vec![1; 1 << 20]).expect_err("there is no space");
            drop(store);
            let collector = Store::open_existing(root).expect("opens");
            // What was made just now is kept, as the advice says; only who asks for it loses it.
            let young = collector.collect(&Collect::default()).expect("`gc` works on a full disk");
            let all = Collect { older_than: Duration::ZERO, ..Collect::default() };
            let freed = collector.collect(&all).expect("`gc` works on a full disk");
            return format!(
                "{error}; clean: {}; left: {stale}; put: {put}; help: {}; gc: {} {}",
                report.is_clean(),
                put.help().unwrap_or_default(),
                young.objects.files == 0,
                freed.objects.files == number as u64,
            );
        }
    }
    "never full".to_owned()
}

/// Runs a shell script in a mount namespace of its own, then the child; `None` where that is not allowed.
fn in_namespace(script: &str, root: &Path) -> Option<String> {
    if !Need::Unshare.runs("unshare", &["-rm", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]) {
        return None;
    }
    let script = format!("{script} && exec \"$@\"");
    let output = spawn(&["unshare", "-rm", "sh", "-c", &script, "sh"], root, "fill").wait_with_output().expect("ends");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let outcome = text.lines().find_map(|line| line.split_once("outcome: ")).map(|(_, outcome)| outcome.to_owned());
    assert!(outcome.is_some(), "{text}{}", String::from_utf8_lossy(&output.stderr));
    outcome
}

#[test]
fn a_full_disk_is_named_and_damages_nothing() {
    let folder = tempfile::tempdir().expect("creates");
    let root = folder.path().to_string_lossy().into_owned();
    let Some(outcome) = in_namespace(&format!("mount -t tmpfs -o size=400k tmpfs {root}"), folder.path()) else {
        return;
    };
    let full = format!("no space is left on the disk of the store `{root}`");
    assert!(outcome.starts_with(&full) && outcome.contains(&format!("put: {full}")), "{outcome}");
    assert!(outcome.contains("clean: true; left: 0;") && outcome.contains("`trodden gc`"), "{outcome}");
    assert!(outcome.ends_with("gc: true true"), "{outcome}");
}

#[test]
fn a_read_only_disk_is_named() {
    let folder = tempfile::tempdir().expect("creates");
    let root = folder.path().to_string_lossy().into_owned();
    drop(Store::open(folder.path()).expect("opens"));
    for (mount, place) in [("", root.clone()), ("/new", format!("{root}/new"))] {
        let script = format!("mount --bind {root} {root} && mount -o remount,ro,bind {root}");
        let Some(outcome) = in_namespace(&script, Path::new(&format!("{root}{mount}"))) else { return };
        assert!(outcome.contains(&format!("the store `{place}` cannot be written to")), "{outcome}");
        assert!(outcome.contains("help: make it writable, or use another store"), "{outcome}");
    }
}

#[test]
fn a_store_in_place_of_which_a_file_is_cannot_be_opened() {
    let file = tempfile::NamedTempFile::new().expect("creates");
    for root in [file.path().to_path_buf(), file.path().join("below")] {
        let error = Store::open(&root).expect_err("there is a file");
        assert!(error.to_string().contains(&*file.path().to_string_lossy()), "{error}");
    }
}
