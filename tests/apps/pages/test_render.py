"""Templates: text escaped, nothing forgotten, files whole or not there."""

import jinja2
import pytest

from poise.apps.pages import render_page, replace_file

BASE = '{% extends "base.html.j2" %}{% block main %}'


def page_of(tmp_path, body, **values):
    template = tmp_path / "own.html.j2"
    template.write_text(f"{BASE}{body}{{% endblock %}}")
    return render_page(template, facts=(), verdict=None, **values)


def test_a_template_of_ones_own_extends_the_kits_frame_and_text_is_escaped(tmp_path):
    page = page_of(tmp_path, "<p>{{ words }}</p>", words="<script>&")
    assert "<p>&lt;script&gt;&amp;</p>" in page
    assert page.startswith("<!DOCTYPE html>")
    assert page.count("<style>") == 1


def test_a_name_without_a_value_is_an_error(tmp_path):
    with pytest.raises(jinja2.UndefinedError, match="words"):
        page_of(tmp_path, "{{ words }}")


def test_a_file_that_cannot_be_written_leaves_the_former_one(tmp_path):
    path = replace_file(tmp_path / "made" / "page.html", "former – page")
    with pytest.raises(UnicodeEncodeError):
        replace_file(path, "\ud800")
    assert path.read_bytes() == "former – page".encode()
    assert [p.name for p in path.parent.iterdir()] == ["page.html"]
