//! The dependency block of ARCHITECTURE.md is the law: each room uses only the rooms that its line names.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// `room → uses` from the block that begins with `doors` in ARCHITECTURE.md.
fn law() -> BTreeMap<String, BTreeSet<String>> {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let start = text.find("```text rooms\n").expect("ARCHITECTURE.md has a block ```text rooms");
    let block = text[start..].lines().skip(1).take_while(|line| *line != "```");
    let mut law = BTreeMap::new();
    for line in block.filter(|line| !line.trim().is_empty()) {
        let (rooms, uses) = line.split_once('→').unwrap_or((line, ""));
        let room = rooms.split_whitespace().last().expect("a room on every line").to_string();
        let uses = uses.split(',').map(|name| name.trim().to_string()).filter(|name| !name.is_empty()).collect();
        law.insert(room, uses);
    }
    law
}

/// `crate → its dependencies inside the workspace` as cargo sees them, without those for tests only.
fn reality() -> BTreeMap<String, BTreeSet<String>> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline", "--manifest-path"])
        .arg(root().join("Cargo.toml"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let room = |name: &str| name.strip_prefix("relumine-").unwrap_or(name).to_string();
    let packages = metadata["packages"].as_array().unwrap();
    packages
        .iter()
        .map(|package| {
            let uses = package["dependencies"]
                .as_array()
                .unwrap()
                .iter()
                .filter(|dependency| {
                    dependency["kind"].is_null() && dependency["name"].as_str().unwrap().starts_with("relumine")
                })
                .map(|dependency| room(dependency["name"].as_str().unwrap()))
                .collect();
            (room(package["name"].as_str().unwrap()), uses)
        })
        .collect()
}

#[test]
fn every_room_uses_only_the_rooms_that_the_architecture_allows() {
    let (law, reality) = (law(), reality());
    assert_eq!(
        law.keys().collect::<Vec<_>>(),
        reality.keys().collect::<Vec<_>>(),
        "rooms in ARCHITECTURE.md and in cargo"
    );
    for (room, uses) in &reality {
        assert_eq!(uses, &law[room], "{room}: what Cargo.toml says (left) and what ARCHITECTURE.md says (right)");
    }
}

#[test]
fn no_room_stands_on_one_above_it() {
    // The block is written from the top down: whatever a room uses must come below it.
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let start = text.find("```text rooms\n").unwrap();
    let lines: Vec<&str> = text[start..].lines().skip(1).take_while(|line| *line != "```").collect();
    let order: Vec<&str> = lines
        .iter()
        .filter(|line| !line.trim().is_empty())
        .map(|line| line.split('→').next().unwrap().split_whitespace().last().unwrap())
        .collect();
    for (room, uses) in law() {
        let place =
            |name: &str| order.iter().position(|other| *other == name).unwrap_or_else(|| panic!("{name} has no line"));
        for below in &uses {
            assert!(place(below) > place(&room), "{room} uses {below}, which stands above it");
        }
    }
}
