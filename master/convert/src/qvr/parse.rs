//! Lines of QVR into a tree.
//! In: text: a key and its words on each line, `#` begins a comment, words may stand in double quotes. Out: blocks of
//! devices, observers and processes, and windows within processes. What the keys mean is read elsewhere.

use crate::error::{Trouble, shown};
use crate::source::{Tree, Word};

const BLOCKS: &str = "\"device NAME\", \"observer NAME\" or \"process NAME\"";

/// In which block the lines are.
enum Section {
    Head,
    Device(usize),
    Observer(usize),
    Process(usize),
    Window { process: usize, window: usize },
}

/// Parses a configuration. Blocks follow each other as QVR wants them: devices, observers, processes.
pub(crate) fn parse(text: &str) -> Result<Tree, Trouble> {
    let mut tree = Tree::new();
    let mut section = Section::Head;
    for (index, text) in text.lines().enumerate() {
        let line = index + 1;
        let mut words = split(text, line)?.into_iter();
        let Some((column, key)) = words.next() else {
            continue;
        };
        let words: Vec<Word> = words.map(|(_, word)| word).collect();
        let key = key.text.as_str();
        let wrong = |expected: &str| {
            Err(Trouble::Syntax {
                line,
                column,
                expected: expected.to_owned(),
                found: shown(key),
            })
        };
        let starts = match (&section, key) {
            (Section::Head | Section::Device(_), "device" | "observer")
            | (Section::Observer(_), "observer")
            | (
                Section::Head | Section::Observer(_) | Section::Process(_) | Section::Window { .. },
                "process",
            )
            | (Section::Process(_) | Section::Window { .. }, "window") => true,
            (Section::Head, _) => return wrong(BLOCKS),
            (Section::Device(_), "window") => return wrong("a key of the device, or an observer"),
            (Section::Observer(_), "device" | "window") => {
                return wrong(
                    "a key of the observer, or a process (devices stand before observers)",
                );
            }
            (Section::Process(_) | Section::Window { .. }, "device")
            | (Section::Process(_), "observer") => {
                return wrong(
                    "a key of the process, or a window (observers stand before processes)",
                );
            }
            _ => false,
        };
        if starts && words.len() != 1 {
            return Err(Trouble::Syntax {
                line,
                column,
                expected: format!("one name after \"{key}\""),
                found: format!("{} words", words.len()),
            });
        }
        let parent = match (&section, starts, key) {
            (Section::Process(process) | Section::Window { process, .. }, true, "window") => {
                *process
            }
            (_, true, _) | (Section::Head, ..) => Tree::ROOT,
            (Section::Device(block) | Section::Observer(block) | Section::Process(block), ..) => {
                *block
            }
            (Section::Window { window, .. }, ..) => *window,
        };
        let entry = tree.add(parent, key, words, line)?;
        if starts {
            section = match key {
                "device" => Section::Device(entry),
                "observer" => Section::Observer(entry),
                "process" => Section::Process(entry),
                _ => Section::Window {
                    process: parent,
                    window: entry,
                },
            };
        }
    }
    Ok(tree)
}

/// The words of a line with their columns, up to a comment.
fn split(text: &str, line: usize) -> Result<Vec<(usize, Word)>, Trouble> {
    let mut words = Vec::new();
    let mut rest = text.char_indices().enumerate().peekable();
    while let Some((column, (start, first))) = rest.next() {
        if first.is_whitespace() {
            continue;
        }
        if first == '#' {
            break;
        }
        if first == '"' {
            let end = rest.find(|(_, (_, c))| *c == '"');
            let Some((_, (end, _))) = end else {
                return Err(Trouble::Syntax {
                    line,
                    column: column + 1,
                    expected: "a closing quote on the same line".to_owned(),
                    found: "the end of the line".to_owned(),
                });
            };
            let inner = text.get(start + 1..end).unwrap_or_default();
            words.push((column + 1, word(inner, true)));
            continue;
        }
        let mut end = start + first.len_utf8();
        while let Some((_, (at, c))) = rest.next_if(|(_, (_, c))| !c.is_whitespace()) {
            end = at + c.len_utf8();
        }
        words.push((
            column + 1,
            word(text.get(start..end).unwrap_or_default(), false),
        ));
    }
    Ok(words)
}

fn word(text: &str, quoted: bool) -> Word {
    Word {
        text: text.to_owned(),
        quoted,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_split_at_blanks_and_quotes() {
        let words = split("\tlauncher \"ssh  host\"  env A=ä # not this", 1).unwrap();
        let texts: Vec<_> = words
            .iter()
            .map(|(column, w)| (*column, w.text.as_str()))
            .collect();
        assert_eq!(
            texts,
            [(2, "launcher"), (11, "ssh  host"), (24, "env"), (28, "A=ä")]
        );
    }

    #[test]
    fn errors_name_line_and_column() {
        let cases = [
            ("size 1 2\n", 1, 1),
            ("observer a\nprocess p\n  window \"w\n", 3, 10),
            ("observer a\n window w\n", 2, 2),
            ("observer\n", 1, 1),
            ("observer a\nprocess p\nobserver b\n", 3, 1),
            ("process p\nwindow w\n\n device d\n", 4, 2),
        ];
        for (text, expected_line, expected_column) in cases {
            match parse(text) {
                Err(Trouble::Syntax { line, column, .. }) => {
                    assert_eq!((line, column), (expected_line, expected_column), "{text}");
                }
                other => panic!("{text}: {other:?}"),
            }
        }
    }
}
