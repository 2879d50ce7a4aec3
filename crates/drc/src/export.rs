//! Output of a result as text, for layout viewers, and for build servers.

use std::fmt::Write;

use metalith_core::text::{is_printable, printable, printable_json};
use metalith_report::{counted, exact, sig};
use serde_json::json;

use super::report::{DrcReport, RuleReport};
use super::rule::{Severity, Status};

/// Middle of the box around an outline: the place that other commands name a shape by.
fn middle_nm(outline_nm: &[[f64; 2]]) -> Option<[f64; 2]> {
    let ends = |axis: usize| {
        let each = || outline_nm.iter().map(|p| p[axis]);
        (
            each().fold(f64::INFINITY, f64::min),
            each().fold(f64::NEG_INFINITY, f64::max),
        )
    };
    let middle = |(low, high): (f64, f64)| low + 0.5 * (high - low);
    (!outline_nm.is_empty()).then(|| [middle(ends(0)), middle(ends(1))])
}

/// Plain text: one line for each rule, followed by its first violations.
pub fn text(report: &DrcReport) -> String {
    const SHOWN: usize = 5;
    let mut out = String::new();
    if let Some(words) = &report.not_understood {
        let _ = writeln!(out, "{}", printable(words));
    }
    let _ = writeln!(
        out,
        "{}: {}, {}, {} on their lattices{}\ndeck: {}\n",
        printable(&report.layout),
        counted(report.shapes as usize, "shape"),
        counted(report.elements, "element"),
        counted(report.pillars_on_lattices as usize, "pillar"),
        (report.turned_deg).map_or_else(String::new, |deg| format!(", at an angle of {} deg", exact(deg))),
        report.deck
    );
    if report.slack_nm > 0.0 {
        let _ = writeln!(
            out,
            "warning: places were rounded one by one, by up to {} nm: distances between pillars are those of their sites, and err by up to {} nm\n",
            sig(report.slack_nm, 2),
            sig(2.0 * report.slack_nm, 2)
        );
    }
    let mut reason = "";
    // Of cells that lie on one another by chance, nothing else counts.
    let (first, rest): (Vec<_>, Vec<_>) = report.rules.iter().partition(|r| r.check == "one_top" && r.open() > 0);
    for r in first.into_iter().chain(rest) {
        let state = match &r.status {
            Status::Run if r.violations == 0 => "ok".to_owned(),
            Status::Run if r.open() == 0 => format!("{} waived", r.waived),
            Status::Run if r.waived > 0 => format!("{} {}, {} waived", r.open(), noun(r), r.waived),
            Status::Run => format!("{} {}", r.open(), noun(r)),
            other => other.word().to_uppercase(),
        };
        let _ = writeln!(out, "{:28} {:>18}  {}", r.id, state, r.words);
        if let Status::Skipped(why) | Status::NotApplicable(why) | Status::Failed(why) = &r.status {
            let said = std::mem::replace(&mut reason, why) == why;
            let _ = writeln!(
                out,
                "{:28} {}",
                "",
                if said {
                    "for the same reason".into()
                } else {
                    printable(why)
                }
            );
        }
        for (name, value) in &r.facts {
            let _ = writeln!(out, "{:28} {}: {}", "", printable(name), exact(*value));
        }
        for m in r.markers.iter().filter(|m| !m.waived).take(SHOWN) {
            let place = middle_nm(&m.outline_nm).map_or_else(String::new, |p| {
                format!(" at ({:.3}, {:.3}) um", p[0] * 1e-3, p[1] * 1e-3)
            });
            let _ = writeln!(out, "{:28} {}{place}  [{}]", "", printable(&m.words), m.hash);
        }
        if r.open() > SHOWN as u64 {
            let _ = writeln!(out, "{:28} and {} more", "", r.open() - SHOWN as u64);
        }
    }
    for warning in &report.warnings {
        let _ = writeln!(out, "warning: {warning}");
    }
    let waived: u64 = report.rules.iter().map(|r| r.waived).sum();
    let notes: u64 = report
        .rules
        .iter()
        .filter(|r| r.severity == Severity::Note)
        .map(RuleReport::open)
        .sum();
    let _ = writeln!(
        out,
        "\n{}: {}; {}, {}, {waived} waived: {}",
        counted(report.rules.len(), "rule"),
        runs(report),
        counted(report.open() as usize, "violation"),
        counted(notes as usize, "note"),
        match report.exit_code() {
            0 => "clean",
            1 => "not clean",
            _ => "not clean, and not all was checked",
        }
    );
    out
}

/// How many rules ran, and the names of those that did not.
fn runs(report: &DrcReport) -> String {
    let mut run = 0;
    let mut others: [(&str, Vec<&str>); 3] =
        ["not run", "not applicable", "not in force without a design"].map(|word| (word, Vec::new()));
    for rule in &report.rules {
        let which = match rule.status {
            Status::Run => {
                run += 1;
                continue;
            }
            Status::Skipped(_) | Status::Failed(_) => 0,
            Status::NotApplicable(_) => 1,
            Status::NotInForce => 2,
        };
        others[which].1.push(&rule.id);
    }
    let mut words = format!("{run} run");
    for (word, rules) in others.iter().filter(|(_, rules)| !rules.is_empty()) {
        let _ = write!(words, "; {} {word}: {}", rules.len(), rules.join(", "));
    }
    words
}

fn noun(rule: &RuleReport) -> &'static str {
    match (rule.severity, rule.open()) {
        (Severity::Error, 1) => "error",
        (Severity::Error, _) => "errors",
        (Severity::Warning, 1) => "warning",
        (Severity::Warning, _) => "warnings",
        (Severity::Note, 1) => "note",
        (Severity::Note, _) => "notes",
    }
}

fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&apos;"),
            // What XML has no place for, and what would change how a line is shown.
            c if !is_printable(c) => out.push_str(&printable(c.encode_utf8(&mut [0; 4]))),
            c => out.push(c),
        }
    }
    out
}

/// Report database of KLayout's marker browser; the parts of a rule's id are nested categories.
pub fn lyrdb(report: &DrcReport) -> String {
    let mut out = format!(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<report-database>\n <description>{}</description>\n \
         <original-file>{}</original-file>\n <generator>metalith check</generator>\n <top-cell>{}</top-cell>\n <tags>\n \
         </tags>\n",
        escaped(&report.deck),
        escaped(&report.layout),
        escaped(&report.top)
    );
    let ids: Vec<(Vec<&str>, &str)> = report
        .rules
        .iter()
        .map(|r| (r.id.split('.').collect(), r.words.as_str()))
        .collect();
    categories(&mut out, &ids, 0, 1);
    let _ = write!(
        out,
        " <cells>\n  <cell>\n   <name>{0}</name>\n   <variant/>\n   <layout-name>{0}</layout-name>\n  </cell>\n </cells>\n <items>\n",
        escaped(&report.top)
    );
    for r in &report.rules {
        for m in &r.markers {
            let points: Vec<String> = m
                .outline_nm
                .iter()
                .map(|p| format!("{:.6},{:.6}", p[0] * 1e-3, p[1] * 1e-3))
                .collect();
            let geometry = match points.len() {
                0 => String::new(),
                1 => format!("    <value>box: ({0};{0})</value>\n", points[0]),
                2 => format!("    <value>box: ({})</value>\n", points.join(";")),
                _ => format!("    <value>polygon: ({})</value>\n", points.join(";")),
            };
            let words = format!("{}{} [{}]", if m.waived { "waived: " } else { "" }, m.words, m.hash);
            let _ = write!(
                out,
                "  <item>\n   <tags/>\n   <category>{}</category>\n   <cell>{}</cell>\n   <visited>{}</visited>\n   \
                 <multiplicity>1</multiplicity>\n   <values>\n{geometry}    <value>text: '{}'</value>\n   </values>\n  </item>\n",
                escaped(&r.id),
                escaped(&report.top),
                m.waived,
                escaped(&words.replace('\\', "\\\\").replace('\'', "\\'"))
            );
        }
    }
    out.push_str(" </items>\n</report-database>\n");
    out
}

/// The categories whose ids share their first `depth` parts, one level of XML.
fn categories(out: &mut String, ids: &[(Vec<&str>, &str)], depth: usize, indent: usize) {
    let pad = " ".repeat(indent);
    let _ = writeln!(out, "{pad}<categories>");
    let mut names: Vec<&str> = Vec::new();
    for name in ids.iter().filter_map(|(parts, _)| parts.get(depth)) {
        if !names.contains(name) {
            names.push(name);
        }
    }
    for name in names {
        let below: Vec<(Vec<&str>, &str)> = ids
            .iter()
            .filter(|(parts, _)| parts.get(depth) == Some(&name))
            .cloned()
            .collect();
        let words = below
            .iter()
            .find(|(parts, _)| parts.len() == depth + 1)
            .map_or("", |b| b.1);
        let _ = writeln!(
            out,
            "{pad} <category>\n{pad}  <name>{}</name>\n{pad}  <description>{}</description>",
            escaped(name),
            escaped(words)
        );
        if below.iter().any(|(parts, _)| parts.len() > depth + 1) {
            categories(out, &below, depth + 1, indent + 2);
        }
        let _ = writeln!(out, "{pad} </category>");
    }
    let _ = writeln!(out, "{pad}</categories>");
}

/// JUnit XML: each rule is a test case; a rule that did not run is an error, never a pass.
pub fn junit(report: &DrcReport) -> String {
    let failed = |r: &&RuleReport| r.status == Status::Run && r.severity > Severity::Note && r.open() > 0;
    let waits = |r: &&RuleReport| matches!(r.status, Status::NotInForce | Status::NotApplicable(_));
    let waiting = report.rules.iter().filter(waits).count();
    let mut out = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n<testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" \
         errors=\"{}\" skipped=\"{waiting}\">\n",
        escaped(&report.deck),
        report.rules.len(),
        report.rules.iter().filter(failed).count(),
        report.not_run()
    );
    for r in &report.rules {
        let head = format!(
            "<testcase classname=\"{}\" name=\"{}\"",
            escaped(&report.layout),
            escaped(&r.id)
        );
        let body = match &r.status {
            Status::Skipped(why) | Status::Failed(why) => {
                format!("<error message=\"{}: {}\"/>", r.status.word(), escaped(why))
            }
            Status::NotApplicable(why) => format!("<skipped message=\"{}\"/>", escaped(why)),
            Status::NotInForce => "<skipped message=\"no design was given\"/>".to_owned(),
            Status::Run if failed(&r) => {
                let lines: Vec<String> = r
                    .markers
                    .iter()
                    .filter(|m| !m.waived)
                    .map(|m| escaped(&format!("{} [{}]", m.words, m.hash)))
                    .collect();
                format!(
                    "<failure message=\"{} of: {}\">{}</failure>",
                    counted(r.open() as usize, "violation"),
                    escaped(&r.words),
                    lines.join("\n")
                )
            }
            Status::Run => String::new(),
        };
        let _ = if body.is_empty() {
            writeln!(out, "{head}/>")
        } else {
            writeln!(out, "{head}>{body}</testcase>")
        };
    }
    out.push_str("</testsuite>\n</testsuites>\n");
    out
}

/// SARIF 2.1.0; the fingerprint of a result is the hash of its rule and place.
pub fn sarif(report: &DrcReport) -> String {
    let level = |severity| match severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
        Severity::Note => "note",
    };
    let uri = report.layout.replace('\\', "/");
    let rules: Vec<_> = report
        .rules
        .iter()
        .map(|r| {
            json!({
                "id": r.id,
                "shortDescription": {"text": r.words},
                "defaultConfiguration": {"level": level(r.severity)},
                "properties": {"check": r.check, "status": r.status.word(), "violations": r.violations, "waived": r.waived},
            })
        })
        .collect();
    let mut results = Vec::new();
    for (index, r) in report.rules.iter().enumerate() {
        for m in &r.markers {
            let suppressions = if m.waived {
                json!([{"kind": "external"}])
            } else {
                json!([])
            };
            results.push(json!({
                "ruleId": r.id,
                "ruleIndex": index,
                "level": level(r.severity),
                "message": {"text": m.words},
                "locations": [{
                    "physicalLocation": {"artifactLocation": {"uri": uri}},
                    "logicalLocations": [{"name": report.top, "kind": "module"}],
                }],
                "partialFingerprints": {"metalithPlace/v1": m.hash},
                "suppressions": suppressions,
                "properties": {"outline_nm": m.outline_nm},
            }));
        }
    }
    let notifications: Vec<_> = report
        .rules
        .iter()
        .filter_map(|r| match &r.status {
            Status::Skipped(why) | Status::Failed(why) => Some(json!({
                "level": "error",
                "message": {"text": format!("{} {}: {why}", r.id, r.status.word())},
                "associatedRule": {"id": r.id},
            })),
            _ => None,
        })
        .collect();
    let sarif = json!({
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{
            "tool": {"driver": {
                "name": "metalith",
                "version": env!("CARGO_PKG_VERSION"),
                "semanticVersion": env!("CARGO_PKG_VERSION"),
                "rules": rules,
            }},
            "invocations": [{
                "executionSuccessful": report.not_run() == 0,
                "exitCode": report.exit_code(),
                "toolExecutionNotifications": notifications,
            }],
            "results": results,
        }],
    });
    printable_json(&format!("{sarif:#}\n")).into_owned()
}
