//! Two drives in one folder.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Says so if the files look like two drives or two cameras, one after the other or by turns: the
/// same numbers under different words (`left_1`, `right_1`), or under different first numbers
/// (`cam0_1`, `cam1_1`).
pub(super) fn two_drives(paths: &[PathBuf]) -> Option<String> {
    let names: Vec<(String, Vec<String>)> = paths.iter().map(|path| parts(path)).collect();
    let by_words = names.iter().map(|(words, numbers)| (words.clone(), numbers.clone()));
    let by_number = names.iter().filter_map(|(words, numbers)| {
        let (first, rest) = numbers.split_first()?;
        (!rest.is_empty()).then(|| (words.replacen('#', first, 1), rest.to_vec()))
    });
    let groups = overlapping(by_words).or_else(|| overlapping(by_number))?;
    let said = groups
        .iter()
        .map(|(words, count)| format!("{} ({count} files)", words.replace('#', "*")))
        .collect::<Vec<_>>();
    Some(format!(
        "two drives or cameras in one folder? {}: take one by a pattern",
        said.join(" and ")
    ))
}

/// The words of a name, with # for each number, and its numbers.
pub(super) fn parts(path: &Path) -> (String, Vec<String>) {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let (mut words, mut numbers) = (String::new(), Vec::<String>::new());
    let mut inside = false;
    for letter in name.chars() {
        let digit = letter.is_ascii_digit();
        match numbers.last_mut() {
            Some(number) if digit && inside => number.push(letter),
            _ if digit => {
                numbers.push(letter.to_string());
                words.push('#');
            }
            _ => words.push(letter),
        }
        inside = digit;
    }
    (words, numbers)
}

/// The groups, if there are 2 to 4 of at least two files each, and half of the numbers of the
/// smallest are also in another.
fn overlapping(names: impl Iterator<Item = (String, Vec<String>)>) -> Option<Vec<(String, usize)>> {
    let mut groups = BTreeMap::<String, BTreeSet<Vec<String>>>::new();
    for (words, numbers) in names {
        groups.entry(words).or_default().insert(numbers);
    }
    groups.retain(|_, numbers| numbers.len() > 1);
    if !(2..=4).contains(&groups.len()) {
        return None;
    }
    let smallest = groups.values().min_by_key(|numbers| numbers.len())?;
    let others = groups.values().filter(|numbers| !std::ptr::eq(*numbers, smallest));
    let shared = others.map(|other| other.intersection(smallest).count()).max()?;
    let said = groups.iter().map(|(words, numbers)| (words.clone(), numbers.len()));
    (2 * shared >= smallest.len()).then(|| said.collect())
}
