"""What the project says about itself is the same in all files that say it."""

import tomllib
from pathlib import Path

from epuck_mj.host.yaml_and_json import read_yaml

ROOT = Path(__file__).resolve().parent.parent


def test_authors_version_and_licence_agree():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    citation = read_yaml(ROOT / "CITATION.cff")
    article = read_yaml(ROOT / "docs" / "metadata.yaml")
    assert citation["title"] == project["description"]
    assert str(citation["version"]) == project["version"]
    assert citation["license"] == project["license"]
    names = [author["name"] for author in citation["authors"]]
    assert [author["name"] for author in article["authors"]] == names


def test_the_article_cites_the_paper_of_the_readme():
    article = read_yaml(ROOT / "docs" / "metadata.yaml")
    assert article["type"] == "Replication"
    readme = " ".join((ROOT / "README.md").read_text().split())
    title = "Robotic Behavior Implementation Using Two Different Differential Evolution"
    assert title in readme
    assert title in article["replication"][0]["cite"]
