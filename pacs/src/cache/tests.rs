//! Tests of the cache's bounds, leftovers and layout.

use std::io::Write as _;
use std::time::Duration;

use super::*;

fn uid(text: &str) -> Uid {
    Uid::read(text).unwrap()
}

fn store(cache: &Cache, study: &str, bytes: usize) -> (InUse, PathBuf) {
    let mut folder = cache.study("0123456789abcdef", &uid(study)).unwrap();
    folder.make_room(bytes as u64).unwrap();
    let mut file = folder.receive().unwrap();
    file.write_all(&vec![1; bytes]).unwrap();
    let path = folder.keep(file, &uid("1.7"), &uid("1.8")).unwrap();
    (folder.finish().unwrap(), path)
}

/// Says that a study was last used some minutes ago.
fn age(cache: &Cache, study: &str, minutes: u64) {
    let path = marker(&cache.folder.join("0123456789abcdef").join(study));
    let file = fs::OpenOptions::new().write(true).open(path).unwrap();
    file.set_modified(SystemTime::now() - Duration::from_secs(60 * minutes)).unwrap();
}

#[test]
fn longest_unused_studies_go_and_those_in_use_stay() {
    let root = tempfile::tempdir().unwrap();
    let cache = Cache::open(root.path(), 100).unwrap();
    let (first, first_path) = store(&cache, "1.1", 40);
    let (second, second_path) = store(&cache, "1.2", 40);
    age(&cache, "1.1", 10);
    age(&cache, "1.2", 20);
    assert_eq!(cache.size().unwrap(), 80);
    // Each study may share its lock with another; these three don't.
    drop(second);
    let (third, third_path) = store(&cache, "1.3", 50);
    assert!(first_path.exists() && !second_path.exists() && third_path.exists());
    assert_eq!(cache.size().unwrap(), 90);
    let mut fourth = cache.study("0123456789abcdef", &uid("1.4")).unwrap();
    let error = fourth.make_room(20).unwrap_err().to_string();
    assert!(error.contains("110 bytes of studies in use") && error.contains("at most 100 bytes"), "{error}");
    drop((first, third, fourth));
    assert_eq!(cache.clear().unwrap(), 0);
    assert!(!first_path.exists() && !root.path().join("0123456789abcdef").exists());
}

#[test]
fn the_longest_unused_study_goes_first() {
    let root = tempfile::tempdir().unwrap();
    let cache = Cache::open(root.path(), 100).unwrap();
    let paths = ["1.1", "1.2", "1.3"].map(|study| store(&cache, study, 30).1);
    age(&cache, "1.1", 20);
    age(&cache, "1.2", 30);
    age(&cache, "1.3", 10);
    let _in_use = store(&cache, "1.4", 30);
    assert_eq!(paths.each_ref().map(|path| path.exists()), [true, false, true]);
    // Using a study again makes it the last to go.
    drop(cache.study("0123456789abcdef", &uid("1.1")).unwrap());
    let _in_use = store(&cache, "1.5", 30);
    assert_eq!(paths.map(|path| path.exists()), [true, false, false]);
}

#[test]
fn leftovers_are_swept_unless_someone_receives() {
    let root = tempfile::tempdir().unwrap();
    let cache = Cache::open(root.path(), 100).unwrap();
    let folder = cache.study("0123456789abcdef", &uid("1.1")).unwrap();
    // As a killed process leaves it.
    let (_, left) = folder.receive().unwrap().keep().unwrap();
    let other = root.path().join("incoming/other.txt");
    fs::copy(&left, &other).unwrap();
    let _again = Cache::open(root.path(), 100).unwrap();
    assert!(left.exists(), "swept while someone receives");
    drop(folder);
    let _again = Cache::open(root.path(), 100).unwrap();
    assert!(!left.exists() && other.exists());
}

#[test]
fn only_what_the_cache_wrote_is_deleted() {
    let root = tempfile::tempdir().unwrap();
    let cache = Cache::open(root.path(), 1000).unwrap();
    let (in_use, path) = store(&cache, "1.1", 10);
    drop(in_use);
    let series = path.parent().unwrap();
    let foreign = [
        root.path().join("notes.txt"),
        root.path().join("documents/1.2/1.3/1.4.dcm"),
        series.join("notes.txt"),
        series.join("..dcm"),
        series.parent().unwrap().join("notes/1.4.dcm"),
    ];
    for file in &foreign {
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::copy(&path, file).unwrap();
    }
    #[cfg(unix)]
    std::os::unix::fs::symlink(
        root.path().join("documents/1.2"),
        path.parent().unwrap().with_file_name("1.99"),
    )
    .unwrap();
    assert_eq!(cache.size().unwrap(), 10);
    assert_eq!(cache.clear().unwrap(), 0);
    assert!(!path.exists());
    for file in &foreign {
        assert!(file.exists(), "{file:?}");
    }
}

#[cfg(unix)]
#[test]
fn files_and_folders_are_this_users_alone() {
    use std::os::unix::fs::PermissionsExt as _;
    let root = tempfile::tempdir().unwrap();
    let (_in_use, path) = store(&Cache::open(&root.path().join("a/b"), 100).unwrap(), "1.1", 10);
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(&path), 0o600);
    let inner = path.ancestors().skip(1).take_while(|folder| *folder != root.path());
    assert!(inner.map(mode).all(|mode| mode == 0o700));
}
