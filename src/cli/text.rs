//! Tables for the terminal.

/// A line for each row: the first `left` columns flush left, the others flush right.
#[must_use]
pub fn columns<const N: usize>(rows: &[[String; N]], left: usize) -> String {
    let width = |c: usize| rows.iter().map(|row| row[c].chars().count()).max().unwrap_or(0);
    let widths: [usize; N] = std::array::from_fn(width);
    let line = |row: &[String; N]| {
        let cell = |(c, text): (usize, &String)| {
            let pad = " ".repeat(widths[c] - text.chars().count());
            if c < left { format!("{text}{pad}") } else { format!("{pad}{text}") }
        };
        let cells: Vec<String> = row.iter().enumerate().map(cell).collect();
        cells.join("  ").trim_end().to_owned() + "\n"
    };
    rows.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up_by_characters() {
        let rows = [["scene", "time", "note"], ["é", "1.25 s", ""]].map(|row| row.map(String::from));
        assert_eq!(columns(&rows, 1), "scene    time  note\né      1.25 s\n");
    }
}
