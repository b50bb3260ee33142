//! Equalizer's ASCII format into a tree.
//! In: text: keys with a value, a list in `[ ]`, a reference in `( )` or a block in `{ }`; comments begin with `#` or
//! `//`. Out: entries. What the keys mean is read elsewhere.

use crate::MAX_DEPTH;
use crate::error::{Trouble, shown};
use crate::source::{Tree, Word};

/// A piece of the text.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Token {
    Word(Word),
    Mark(char),
    End,
}

struct Tokens<'s> {
    rest: std::iter::Peekable<std::str::Chars<'s>>,
    line: usize,
    column: usize,
}

/// A token, and where it begins.
struct Found {
    token: Token,
    line: usize,
    column: usize,
}

impl Found {
    fn wrong(&self, expected: impl Into<String>) -> Trouble {
        let found = match &self.token {
            Token::Word(word) => shown(&word.text),
            Token::Mark(mark) => shown(&mark.to_string()),
            Token::End => "the end of the file".to_owned(),
        };
        Trouble::Syntax {
            line: self.line,
            column: self.column,
            expected: expected.into(),
            found,
        }
    }

    /// A word that can be a key.
    fn key(&self) -> Option<&str> {
        match &self.token {
            Token::Word(word) if !word.quoted => Some(word.text.as_str())
                .filter(|text| text.starts_with(|c: char| c.is_ascii_alphabetic())),
            _ => None,
        }
    }
}

impl Tokens<'_> {
    fn next_char(&mut self) -> Option<char> {
        let c = self.rest.next()?;
        if c == '\n' {
            self.line += 1;
            self.column = 1;
        } else {
            self.column += 1;
        }
        Some(c)
    }

    fn skip_blanks(&mut self) {
        while let Some(c) = self.rest.peek().copied() {
            let is_comment = c == '#' || (c == '/' && self.is_double_slash());
            if is_comment {
                while self.rest.peek().is_some_and(|c| *c != '\n') {
                    self.next_char();
                }
            } else if c.is_whitespace() {
                self.next_char();
            } else {
                return;
            }
        }
    }

    fn is_double_slash(&self) -> bool {
        let mut ahead = self.rest.clone();
        ahead.next() == Some('/') && ahead.next() == Some('/')
    }

    fn next(&mut self) -> Result<Found, Trouble> {
        self.skip_blanks();
        let (line, column) = (self.line, self.column);
        let found = |token| Found {
            token,
            line,
            column,
        };
        let Some(first) = self.next_char() else {
            return Ok(found(Token::End));
        };
        if "{}[]()".contains(first) {
            return Ok(found(Token::Mark(first)));
        }
        let mut text = String::new();
        if first == '"' {
            loop {
                match self.next_char() {
                    Some('"') => break,
                    Some(c) if c != '\n' => text.push(c),
                    _ => {
                        return Err(
                            found(Token::Mark('"')).wrong("a closing quote on the same line")
                        );
                    }
                }
            }
            return Ok(found(Token::Word(Word { text, quoted: true })));
        }
        if first == '\'' {
            // A character, for example the quote of a launch command.
            let (inner, end) = (self.next_char(), self.next_char());
            return match (inner, end) {
                (Some(c), Some('\'')) => {
                    text.push(c);
                    Ok(found(Token::Word(Word { text, quoted: true })))
                }
                _ => Err(found(Token::Mark('\'')).wrong("one character between single quotes")),
            };
        }
        let is_part = |c: char| c.is_ascii_alphanumeric() || "_.+-".contains(c);
        if !is_part(first) {
            return Err(found(Token::Mark(first)).wrong("a key, a value or a bracket"));
        }
        text.push(first);
        while let Some(c) = self.rest.next_if(|c| is_part(*c)) {
            self.column += 1;
            text.push(c);
        }
        Ok(found(Token::Word(Word {
            text,
            quoted: false,
        })))
    }
}

/// Parses a configuration.
pub(crate) fn parse(text: &str) -> Result<Tree, Trouble> {
    let mut tree = Tree::new();
    let mut tokens = Tokens {
        rest: text.chars().peekable(),
        line: 1,
        column: 1,
    };
    // Open blocks, and what closes them.
    let mut open: Vec<(usize, char)> = Vec::new();
    let mut next = tokens.next()?;
    loop {
        let parent = open.last().map_or(Tree::ROOT, |(block, _)| *block);
        if let Token::Mark(mark) = next.token
            && open.last().is_some_and(|(_, close)| *close == mark)
        {
            open.pop();
            next = tokens.next()?;
            continue;
        }
        if next.token == Token::End && open.is_empty() {
            return Ok(tree);
        }
        let Some(key) = next.key() else {
            return Err(match open.last() {
                Some((_, close)) => next.wrong(format!("a key or \"{close}\"")),
                None => next.wrong("\"server\", \"config\" or \"global\""),
            });
        };
        let (key, line) = (key.to_owned(), next.line);
        let key = key.as_str();
        let value = tokens.next()?;
        match value.token {
            Token::Mark(mark @ ('{' | '(')) => {
                if open.len() >= MAX_DEPTH {
                    return Err(value.wrong(format!("at most {MAX_DEPTH} levels of brackets")));
                }
                let block = tree.add(parent, key, Vec::new(), line)?;
                open.push((block, if mark == '{' { '}' } else { ')' }));
                next = tokens.next()?;
            }
            Token::Mark('[') => {
                let mut words = Vec::new();
                loop {
                    let item = tokens.next()?;
                    match item.token {
                        Token::Word(word) => words.push(word),
                        Token::Mark(']') => break,
                        _ => return Err(item.wrong("a value or \"]\"")),
                    }
                }
                tree.add(parent, key, words, line)?;
                next = tokens.next()?;
            }
            Token::Word(word) => {
                let mut words = vec![word];
                next = tokens.next()?;
                // "CORE 2" and "SOCKET 1" are one value; a key never begins with a digit.
                if let Token::Word(number) = &next.token
                    && !number.quoted
                    && next.key().is_none()
                {
                    words.push(number.clone());
                    next = tokens.next()?;
                }
                tree.add(parent, key, words, line)?;
            }
            _ => return Err(value.wrong(format!("a value, a list or a block after \"{key}\""))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_lists_references_and_values_are_read() {
        let text = "#Equalizer 1.2 ascii // header\nserver{ config { a \"x y\" b [ 1 -.5 ] c ( canvas 0 view \"v\" ) d CORE 2 e ON } }";
        let tree = parse(text).unwrap();
        let config = tree.root().get("server").unwrap().get("config").unwrap();
        assert_eq!(config.get("a").unwrap().text(), Ok("x y"));
        assert_eq!(config.get("b").unwrap().numbers(), Ok([1.0, -0.5]));
        assert_eq!(
            config.get("c").unwrap().get("view").unwrap().text(),
            Ok("v")
        );
        assert_eq!(config.get("d").unwrap().words().len(), 2);
        assert_eq!(config.get("e").unwrap().text(), Ok("ON"));
    }

    #[test]
    fn errors_name_line_and_column() {
        let deep = "a{".repeat(100);
        let cases = [
            ("server\n{\n  config", 3, 9),
            ("server { ] }", 1, 10),
            ("server { name \"a\n\" }", 1, 15),
            ("server { v [ 1 { ] }", 1, 16),
            ("server { 5 }", 1, 10),
            ("server } ", 1, 8),
            ("server { a ; }", 1, 12),
            ("}", 1, 1),
            (deep.as_str(), 1, 130),
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
