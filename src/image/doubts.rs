//! Names whose order may not be that of the drive.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::drives::parts;

/// What to do then.
const CHOOSE: &str = "choose the order \"time\" or \"exif\"";

/// Says so if the files, which are sorted by name, may have been taken in another order.
pub(super) fn doubtful(paths: &[PathBuf]) -> impl Iterator<Item = String> {
    [wrapped(paths), day_first(paths), twelve_hours(paths)].into_iter().flatten()
}

/// A counter that went on from 9999 at 0001: numbers of as many digits near both ends, and nearly
/// none between.
fn wrapped(paths: &[PathBuf]) -> Option<String> {
    // Of the folder, the words and all numbers but the last; and the width of that.
    type Group<'a> = (Option<&'a Path>, String, Vec<String>, usize);
    let mut groups = BTreeMap::<Group<'_>, BTreeMap<u64, &PathBuf>>::new();
    for path in paths {
        let (words, mut numbers) = parts(Path::new(path.file_stem()?));
        let Some(last) = numbers.pop() else { continue };
        let Ok(number) = last.parse::<u64>() else { continue };
        let group = (path.parent(), words, numbers, last.len());
        groups.entry(group).or_default().insert(number, path);
    }
    groups.values().find_map(|numbers| {
        let (&first, &last) = (numbers.keys().next()?, numbers.keys().next_back()?);
        let digits = last.checked_ilog10()? + 1;
        let all = 10_u64.checked_pow(digits)?;
        let sorted: Vec<u64> = numbers.keys().copied().collect();
        let widest = sorted.windows(2).max_by_key(|pair| pair[1] - pair[0])?;
        let (gap, over) = (widest[1] - widest[0], first + all - last);
        let mut steps: Vec<u64> = sorted.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_unstable();
        let usual = steps[steps.len() / 2];
        // Of two numbers, one step is both the usual and the widest.
        let alone = sorted.len() == 2 && over <= 2;
        let wraps =
            digits > 2 && 2 * gap >= all && 20 * over <= gap && (20 * usual <= gap || alone);
        wraps.then(|| {
            format!(
                "the counter may have wrapped between {} and {}, which come last and first: {CHOOSE}",
                stem(numbers[&last]),
                stem(numbers[&first])
            )
        })
    })
}

/// Dates like 31-01-2026, whose days come before months and years.
fn day_first(paths: &[PathBuf]) -> Option<String> {
    let dates: Vec<[u32; 3]> = paths.iter().filter_map(|path| date(&stem(path))).collect();
    let ascend = |key: &dyn Fn(&[u32; 3]) -> [u32; 3]| dates.is_sorted_by_key(key);
    let fits = |at: usize| dates.iter().all(|date| date[at] <= 12);
    let out_of_order = (fits(1) && !ascend(&|&[day, month, year]| [year, month, day]))
        || (fits(0) && !ascend(&|&[month, day, year]| [year, month, day]));
    out_of_order
        .then(|| format!("the dates in the files' names do not begin with the year: {CHOOSE}"))
}

/// The first date of the form 31-01-2026: 2, 2 and 4 digits, and one mark between.
fn date(name: &str) -> Option<[u32; 3]> {
    let bytes = name.as_bytes();
    let digits = |from: usize, to: usize| {
        let text = bytes.get(from..to)?;
        text.iter().all(u8::is_ascii_digit).then_some(())?;
        name.get(from..to)?.parse::<u32>().ok()
    };
    (0..bytes.len()).find_map(|at| {
        let free = |at: Option<usize>| {
            at.and_then(|at| bytes.get(at)).is_none_or(|byte| !byte.is_ascii_digit())
        };
        let mark = *bytes.get(at + 2)?;
        let marked = b"-._".contains(&mark) && bytes.get(at + 5) == Some(&mark);
        let alone = free(at.checked_sub(1)) && free(Some(at + 10));
        let found = [digits(at, at + 2)?, digits(at + 3, at + 5)?, digits(at + 6, at + 10)?];
        let [one, two, year] = found;
        let fits = (1..=31).contains(&one) && (1..=31).contains(&two) && one.min(two) <= 12;
        (marked && alone && fits && (1900..2200).contains(&year)).then_some(found)
    })
}

/// Clocks of 12 hours, such as 1.00.00 PM after 9.59.00 AM.
fn twelve_hours(paths: &[PathBuf]) -> Option<String> {
    let mut latest = BTreeMap::<String, Vec<u32>>::new();
    let mut out_of_order = false;
    for path in paths {
        let Some((before, time)) = clock(&stem(path).to_lowercase()) else { continue };
        let last = latest.entry(before).or_default();
        out_of_order |= *last > time;
        *last = time;
    }
    out_of_order.then(|| {
        format!("the clock of 12 hours in the files' names (AM, PM) is not in its order: {CHOOSE}")
    })
}

/// What stands before a time like `1.00.00 pm`; and its hours of 24, its minutes and its seconds.
fn clock(name: &str) -> Option<(String, Vec<u32>)> {
    let letters: Vec<char> = name.chars().collect();
    let is_word = |at: usize| {
        let half = matches!(letters.get(at..at + 2), Some(['a' | 'p', 'm']));
        half && letters.get(at + 2).is_none_or(|letter| !letter.is_alphanumeric())
    };
    let word = (1..letters.len()).find(|&at| is_word(at))?;
    // A blank, of any kind, may stand between.
    let mut end = word - usize::from(!letters[word - 1].is_alphanumeric());
    let (mut numbers, mut marks) = (Vec::new(), BTreeSet::new());
    loop {
        let digits = letters[..end].iter().rev().take_while(|letter| letter.is_ascii_digit());
        let count = digits.count();
        if !(1..=2).contains(&count) {
            break;
        }
        let number: String = letters[end - count..end].iter().collect();
        numbers.insert(0, number.parse().ok()?);
        end -= count;
        let mark = end.checked_sub(1).map(|at| letters[at]);
        let goes_on = mark.is_some_and(|mark| {
            marks.insert(mark);
            ".:-_".contains(mark) && marks.len() == 1
        });
        if numbers.len() == 3 || !goes_on {
            break;
        }
        end -= 1;
    }
    let hour = numbers.first_mut().filter(|hour| (1..=12).contains(*hour))?;
    *hour = *hour % 12 + if letters[word] == 'p' { 12 } else { 0 };
    Some((letters[..end].iter().collect(), numbers))
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(names: &[String]) -> Vec<String> {
        doubtful(&names.iter().map(PathBuf::from).collect::<Vec<_>>()).collect()
    }

    fn counted(prefix: &str, digits: usize, numbers: impl Iterator<Item = u32>) -> Vec<String> {
        numbers.map(|number| format!("{prefix}{number:0digits$}.jpg")).collect()
    }

    #[test]
    fn a_counter_that_wraps_is_said() {
        for (prefix, digits, top) in
            [("IMG_", 4, 9999), ("DSC", 5, 9999), ("DJI_", 4, 999), ("a/f", 6, 999_999)]
        {
            let found = said(&counted(prefix, digits, (1..30).chain(top - 19..=top)));
            assert_eq!(found.len(), 1, "{prefix}: {found:?}");
            let (last, first) = (format!("{top:0digits$} "), format!("{:0digits$},", 1));
            assert!(found[0].contains(&last) && found[0].contains(&first), "{found:?}");
            // From 0 on, and every second file.
            let thinned = (0..30).step_by(2).chain((top - 19..=top).step_by(2));
            assert_eq!(said(&counted(prefix, digits, thinned)).len(), 1, "{prefix}");
        }
        for plain in [
            counted("IMG_", 4, 1..200),
            counted("IMG_", 4, 9000..=9999),
            counted("IMG_", 4, (1..3000).chain(3500..=9999)),
            counted("IMG_", 4, [0, 500, 999].into_iter()),
            // The numbers are counted on: of other lengths.
            counted("f", 1, (1..9).chain(9990..=9999)),
            counted("f", 2, (1..9).chain(90..=99)),
        ] {
            assert_eq!(said(&plain), Vec::<String>::new());
        }
    }

    #[test]
    fn dates_and_clocks_out_of_order_are_said() {
        let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
        let found = |list: &[&str]| said(&names(list)).concat();
        assert!(found(&["01-02-2026.png", "28-01-2026.png"]).contains("begin with the year"));
        assert!(found(&["01-05-2026.png", "12-31-2025.png"]).contains("begin with the year"));
        assert_eq!(found(&["30-01-2026 1.png", "31-01-2026 1.png"]), "");
        assert_eq!(found(&["2026-01-28.png", "2026-02-01.png"]), "");
        let shot = "Screenshot 2026-01-28 at";
        let shots = |times: [&str; 2]| {
            let both = times.map(|time| format!("{shot} {time}.png"));
            said(&both).concat()
        };
        assert!(shots(["1.00.00 PM", "9.59.00 AM"]).contains("12 hours"));
        assert!(shots(["1.00.00\u{202f}PM", "11.59.00\u{202f}AM"]).contains("12 hours"));
        assert!(shots(["03-05pm", "10-15am"]).contains("12 hours"));
        assert_eq!(shots(["1.00.00 PM", "9.59.00 PM"]), "");
        assert_eq!(shots(["12.10.00 PM", "12.20.00 PM"]), "");
        assert_eq!(found(&["cam1 pm.png", "ham 2.png", "spam_3am4.png"]), "");
    }
}
