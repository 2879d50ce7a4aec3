//! The page itself.

use std::path::Path;

use super::figure::{Figure, STYLE};
use super::table::{Table, Verdict};
use metalith_core::text::printable_lines;
use metalith_core::{AtomicFile, Result};

/// Styles of text and tables; those of drawings, and the colours of both, stand beside the drawings.
const PAGE_STYLE: &str = include_str!("page.css");

/// Letters of a fact that is set in large type.
const LONGEST_FACT: usize = 20;

/// Closes figures that followed one another; one more is put before it. A row that was asked for ends
/// without the first line break, and is left alone.
const END_OF_FIGURES: &str = "\n</div>\n";

/// One report, from top to bottom.
#[derive(Clone, Debug)]
pub struct Page {
    title: String,
    subtitle: String,
    sections: Vec<String>,
    body: String,
}

impl Page {
    /// A page with its title and one line below it.
    pub fn new(title: impl Into<String>, subtitle: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            subtitle: subtitle.into(),
            sections: Vec::new(),
            body: String::new(),
        }
    }

    /// The banner: what came out, in one sentence. Belongs first.
    pub fn verdict(&mut self, verdict: Verdict, words: impl AsRef<str>) -> &mut Self {
        self.banner(verdict, verdict.word(), words.as_ref())
    }

    /// The banner of a question that is not answered by pass or fail: `label` in the colour of the verdict, then what came out, in
    /// one sentence, without the label if it begins with it.
    pub fn finding(&mut self, verdict: Verdict, label: &str, words: impl AsRef<str>) -> &mut Self {
        let words = words.as_ref();
        self.banner(verdict, label, words.strip_prefix(label).unwrap_or(words))
    }

    fn banner(&mut self, verdict: Verdict, label: &str, rest: &str) -> &mut Self {
        self.body.push_str(&format!(
            "<p class=\"banner {}\" role=\"status\">{} {}</p>\n",
            verdict.class(),
            verdict.labelled(label),
            inline(rest.trim_start_matches([':', ',', ' ']))
        ));
        self
    }

    /// A few numbers in large type, each with its name.
    pub fn facts(&mut self, facts: &[(&str, String)]) -> &mut Self {
        self.body.push_str("<dl class=\"facts\">\n");
        for (name, value) in facts {
            // Words instead of a number would shout in the type of numbers.
            let class = if value.chars().count() > LONGEST_FACT {
                " class=\"words\""
            } else {
                ""
            };
            self.body.push_str(&format!(
                "<div><dt>{}</dt><dd{class}>{}</dd></div>\n",
                escape(name),
                escape(value)
            ));
        }
        self.body.push_str("</dl>\n");
        self
    }

    /// Begin a section; from four sections on, the page gets a list of them at its head.
    pub fn section(&mut self, name: impl AsRef<str>) -> &mut Self {
        let name = escape(name.as_ref());
        let number = self.sections.len() + 1;
        self.body.push_str(&format!("<h2 id=\"s{number}\">{name}</h2>\n"));
        self.sections.push(name);
        self
    }

    /// Begin a part of a section.
    pub fn subsection(&mut self, name: impl AsRef<str>) -> &mut Self {
        self.body.push_str(&format!("<h3>{}</h3>\n", escape(name.as_ref())));
        self
    }

    /// A paragraph; words between back quotes are set as code.
    pub fn paragraph(&mut self, words: impl AsRef<str>) -> &mut Self {
        self.body.push_str(&format!("<p>{}</p>\n", inline(words.as_ref())));
        self
    }

    /// A paragraph that must not be overlooked.
    pub fn note(&mut self, words: impl AsRef<str>) -> &mut Self {
        self.body
            .push_str(&format!("<p class=\"note\">{}</p>\n", inline(words.as_ref())));
        self
    }

    /// A list; words between back quotes are set as code.
    pub fn list<T: AsRef<str>>(&mut self, items: impl IntoIterator<Item = T>) -> &mut Self {
        self.body.push_str("<ul>\n");
        for item in items {
            self.body.push_str(&format!("<li>{}</li>\n", inline(item.as_ref())));
        }
        self.body.push_str("</ul>\n");
        self
    }

    /// Text as it is: commands, files, formulas over several lines.
    pub fn code(&mut self, text: impl AsRef<str>) -> &mut Self {
        self.body
            .push_str(&format!("<pre><code>{}</code></pre>\n", escape(text.as_ref())));
        self
    }

    /// A table.
    pub fn table(&mut self, table: Table) -> &mut Self {
        self.body.push_str(&table.html());
        self
    }

    /// A figure, never larger than it was drawn. Figures that follow one another stand side by side
    /// where there is room.
    pub fn figure(&mut self, figure: impl Into<Figure>) -> &mut Self {
        match self.body.strip_suffix(END_OF_FIGURES).map(str::len) {
            Some(length) => self.body.truncate(length),
            None => self.body.push_str("<div class=\"row\">"),
        }
        self.put(&figure.into());
        self.body.push_str(END_OF_FIGURES);
        self
    }

    /// Figures side by side, as many in a row as there is room for.
    pub fn row(&mut self, figures: impl IntoIterator<Item = Figure>) -> &mut Self {
        self.body.push_str("<div class=\"row\">");
        for figure in figures {
            self.put(&figure);
        }
        self.body.push_str("</div>\n");
        self
    }

    /// Section that most readers may skip, folded behind a line of words; unfolded in print.
    pub fn details(&mut self, words: impl AsRef<str>, fill: impl FnOnce(&mut Page)) -> &mut Self {
        let mut inner = Page::new("", "");
        inner.sections.clone_from(&self.sections);
        fill(&mut inner);
        self.sections = inner.sections;
        self.body.push_str(&format!(
            "<details><summary>{}</summary>\n{}</details>\n",
            inline(words.as_ref()),
            inner.body
        ));
        self
    }

    fn put(&mut self, figure: &Figure) {
        self.body.push_str(&format!(
            "\n<figure style=\"--width:{}px\">\n{}\n<figcaption>{}{}</figcaption></figure>",
            figure.width.round(),
            figure.svg,
            if figure.title == figure.caption {
                String::new()
            } else {
                format!("<b>{}.</b> ", inline(figure.title.trim_end_matches('.')))
            },
            inline(&figure.caption)
        ));
    }

    /// The whole file.
    pub fn html(&self) -> String {
        let title = escape(&self.title);
        let mut contents = String::new();
        if self.sections.len() > 3 {
            contents.push_str("<nav aria-label=\"Sections\"><ul>");
            for (i, name) in self.sections.iter().enumerate() {
                contents.push_str(&format!("<li><a href=\"#s{}\">{name}</a></li>", i + 1));
            }
            contents.push_str("</ul></nav>\n");
        }
        let subtitle = match self.subtitle.as_str() {
            "" => String::new(),
            words => format!("<p class=\"subtitle\">{}</p>\n", inline(words)),
        };
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n\
             <title>{title}</title>\n<style>\n{STYLE}{PAGE_STYLE}</style>\n</head>\n<body>\n<main>\n\
             <header>\n<h1>{title}</h1>\n{subtitle}</header>\n{contents}{}\
             <footer>metalith {}</footer>\n</main>\n</body>\n</html>\n",
            self.body,
            env!("CARGO_PKG_VERSION"),
        )
    }

    /// Write the whole file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        AtomicFile::write(path, self.html().as_bytes())
    }
}

/// Text that cannot be taken for markup, and that shows what is not printable.
pub(super) fn escape(text: &str) -> String {
    printable_lines(text)
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// Text in which back quotes set code; one without a partner stands for itself.
pub(super) fn inline(text: &str) -> String {
    let parts: Vec<_> = text.split('`').collect();
    let paired = parts.len() - (1 - parts.len() % 2);
    let mut html = String::new();
    for (i, part) in parts.iter().enumerate() {
        match i {
            i if i >= paired => html.push_str(&format!("`{}", escape(part))),
            i if i % 2 == 1 => html.push_str(&format!("<code>{}</code>", escape(part))),
            _ => html.push_str(&escape(part)),
        }
    }
    html
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_that_follow_one_another_share_a_row() {
        let figure = || Figure::new(100.0, 50.0, "t", "w", svg::node::element::Group::new());
        let rows = |page: &Page| page.html().matches("<div class=\"row\">").count();
        let mut page = Page::new("", "");
        page.figure(figure()).figure(figure());
        assert_eq!(rows(&page), 1);
        page.row([figure(), figure()]).figure(figure()).row([figure()]);
        assert_eq!(rows(&page), 4, "rows that were asked for stand alone");
        page.figure(figure()).paragraph("between").figure(figure());
        assert_eq!(rows(&page), 6);
    }

    #[test]
    fn text_is_text_whatever_it_holds() {
        assert_eq!(inline("a `b<c` & `d"), "a <code>b&lt;c</code> &amp; `d");
        assert_eq!(inline("`x`"), "<code>x</code>");
        let mut page = Page::new("</title><script>", "");
        page.paragraph("<img src=x>").verdict(Verdict::Fail, "<b>");
        let html = page.html();
        assert!(!html.contains("<script") && !html.contains("<img src") && !html.contains("<b>"));
        assert_eq!(inline("a\u{202e}b `c\u{1b}`"), "a\\u{202e}b <code>c\\u{1b}</code>");
    }
}
