"""Tables of other people's answers: forms, mappings, and what is refused."""

import numpy as np
import pandas as pd
import pytest

from asperity.cli import main
from asperity.errors import AsperityError
from asperity.psychophysics.outside.reading import read_answers

KINDS = ["wood", "plastic", "paper"]


def viper(folder, people=4, materials=6):
    rows = [
        {"category": KINDS[m % 3], "sample": m + 1, "subject": p + 1, "roughtness": (m + p) % 11}
        for m in range(materials) for p in range(people)
    ]  # fmt: skip
    pd.DataFrame(rows).to_excel(folder / "BEHAVIORAL.xlsx", index=False)
    return folder / "BEHAVIORAL.xlsx"


def feet(folder):
    rows = [
        {"Texture": float(t), "Condition": c, "Trial": 1.0, "Metric": metric, "Rating": t + 1.0,
         "Participant": f"PPT_{p:03d}"}
        for t in range(1, 5) for c in ("walking", "hand") for p in range(3)
        for metric in ("roughness", "hardness")
    ]  # fmt: skip
    rows[0]["Rating"] = np.nan
    rows.append({"Metric": "stability_score", "Participant": "PPT_000"})
    pd.DataFrame(rows).to_csv(folder / "collated.csv")
    return folder / "collated.csv"


def test_ratings_through_a_tool(tmp_path):
    answers = read_answers([viper(tmp_path)])
    assert answers.described() == "6 materials, 4 people, 24 ratings"
    assert answers.stimuli == ["1", "2", "3", "4", "5", "6"]
    assert answers.matrix()[1, 2] == 3.0


def test_one_person_a_file_with_speeds(tmp_path):
    for person in ("S1", "S2"):
        rows = [
            {"material": m, "speed_text": s, "speed": 0, "rec_start": 1.7e9, "rough": m + 1}
            for m in range(1, 4) for s in ("free", "slow")
        ]  # fmt: skip
        pd.DataFrame(rows).to_csv(tmp_path / f"{person}.csv", index=False)
    answers = read_answers([tmp_path / "S1.csv", tmp_path / "S2.csv"])
    assert answers.participants == ["S1", "S2"]
    assert answers.described() == "3 materials, 2 people, 2 speeds, 12 ratings"
    assert answers.cells[0] == ("1", "free")


def test_rows_of_another_kind_and_without_a_rating_are_left_out_and_mentioned(tmp_path):
    answers = read_answers([feet(tmp_path)])
    assert answers.described() == "4 materials, 3 people, 2 conditions, 23 ratings"
    assert answers.notes == (
        "25 rows whose Metric is not roughness were left out",
        "1 of 24 rows have no rating and were left out",
    )
    hard = read_answers([feet(tmp_path)], where=["Metric=hardness"])
    assert len(hard.table) == 24


def test_columns_by_mapping_and_two_conditions(tmp_path):
    (tmp_path / "a.csv").write_text(
        "who;what;speed;hand;score\nA;fine;1;left;2\nA;coarse;1;left;5,5\n".replace(",5", "")
    )
    mapping = ["participant=who", "stimulus=what", "condition=speed", "condition=hand",
               "rating=score"]  # fmt: skip
    answers = read_answers([tmp_path / "a.csv"], columns=mapping)
    assert answers.conditions == ["1, left"]
    assert answers.matrix().tolist() == [[5.0, 2.0]]


def test_psychopys_wide_csv_by_name(tmp_path):
    (tmp_path / "p.csv").write_text(
        "grit,trials.thisN,slider.response,slider.rt,participant,date,expName,psychopyVersion,\n"
        ",,,,P1,x,rough,2024.2,\nP40,0,8,1.1,P1,x,rough,2024.2,\nP120,1,3,0.9,P1,x,rough,2024.2,\n"
    )
    answers = read_answers([tmp_path / "p.csv"])
    assert answers.form == "PsychoPy"
    assert answers.described() == "2 stimuli, 1 person, 2 ratings"
    assert "1 of 3 rows have no rating" in answers.notes[0]


def test_psychopys_wide_csv_asks_where_it_cannot_know(tmp_path):
    (tmp_path / "p.csv").write_text(
        "grit,side,slider.response,participant,psychopyVersion\nP40,left,8,P1,2024.2\n"
    )
    with pytest.raises(AsperityError, match=r"--columns stimulus=one of grit, side"):
        read_answers([tmp_path / "p.csv"])
    answers = read_answers([tmp_path / "p.csv"], columns=["stimulus=grit"])
    assert answers.stimuli == ["P40"]


def test_choices_by_name_or_place(tmp_path):
    (tmp_path / "c.csv").write_text(
        "participant,first,second,chosen\nA,x,y,y\nA,y,z,1\nB,x,z,second\n"
    )
    answers = read_answers([tmp_path / "c.csv"])
    assert answers.method == "choice"
    assert answers.orders() == [[1, 0], [1, 2], [2, 0]]
    with pytest.raises(AsperityError, match="no ratings"):
        answers.matrix()


def test_rankings(tmp_path):
    (tmp_path / "r.csv").write_text(
        "participant,trial,stimulus,rank\nA,1,x,2\nA,1,y,1\nA,1,z,3\nB,1,z,1\nB,1,x,2\n"
    )
    answers = read_answers([tmp_path / "r.csv"])
    assert answers.method == "ranking"
    assert answers.orders() == [[1, 0, 2], [2, 0]]


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        ("", {}, "empty or damaged"),
        ("a,b\n1,2\n", {}, r"columns of no method; map them.*it has a, b"),
        ("stimulus,rating\nx,loud\n", {}, "rating must be a number, got 'loud'"),
        ("stimulus,rating\nx,\n", {}, "every row lacks an answer"),
        ("stimulus,rating\nx,1\n", {"columns": ["rating=score"]}, "no column 'score'"),
        ("stimulus,rating\nx,1\n", {"columns": ["mood=rating"]}, "columns name 'mood'"),
        ("stimulus,rating\nx,1\n", {"columns": ["rating"]}, "must be name=column"),
        ("stimulus,rating\nx,1\n", {"where": ["stimulus=y"]}, "no row has stimulus = y"),
        ("stimulus,rating\nx,1\n", {"method": "choice"}, "choice needs a column first"),
        ("first,second,chosen\nx,y,z\n", {}, "chosen must be the name.*got 'z'"),
    ],
)
def test_what_cannot_be_understood_is_refused_in_one_line(tmp_path, text, options, said):
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(AsperityError, match=said) as refused:
        read_answers([tmp_path / "t.csv"], **options)
    assert "\n" not in str(refused.value)


def test_other_files_are_refused(tmp_path):
    (tmp_path / "S1.mat").write_bytes(b"MATLAB 5.0")
    with pytest.raises(AsperityError, match="writetable"):
        read_answers([tmp_path / "S1.mat"])
    (tmp_path / "x.xlsx").write_bytes(b"PK\x03\x04broken")
    with pytest.raises(AsperityError, match=r"x\.xlsx"):
        read_answers([tmp_path / "x.xlsx"])
    with pytest.raises(AsperityError, match="no such file"):
        read_answers([tmp_path / "nothing.csv"])


def test_the_command_tells_what_it_read(tmp_path, capsys):
    path = feet(tmp_path)
    assert main(["analyse", str(path), "--samples", "100"]) == 0
    said = capsys.readouterr().out
    assert "4 materials, 3 people, 2 conditions" in said
    assert "1 of 24 rows have no rating" in said
    names = {p.name for p in (tmp_path / "collated.analysis").glob("[!.]*")}
    assert names == {"analysis.json", "answers.csv", "means.png", "means.svg"}
    assert main(["analyse", str(tmp_path), "--columns", "rating=Rating"]) == 2


ROWS = [
    {"Participant": f"P{p}", "Stimulus": name, "Rating": s + 0.25 * p + 0.5}
    for p in range(4)
    for s, name in enumerate(("None", "NA", "Körnung"))
]


@pytest.mark.parametrize(
    ("encoding", "form"),
    [("utf-8", {}), ("cp1252", {"sep": ";", "decimal": ","}), ("utf-16", {"sep": "\t"})],
)
def test_tables_as_spreadsheets_in_europe_write_them(tmp_path, encoding, form):
    text = "# sheet 1\n" + pd.DataFrame(ROWS).to_csv(index=False, **form)
    (tmp_path / "a.csv").write_bytes(text.encode(encoding))
    answers = read_answers([tmp_path / "a.csv"])
    assert sorted(answers.stimuli) == ["Körnung", "NA", "None"]
    assert answers.table.rating.tolist() == [row["Rating"] for row in ROWS]
    assert answers.notes == ()


def test_words_and_codes_of_missing_answers(tmp_path):
    table = pd.DataFrame(ROWS).astype({"Rating": object})
    table.loc[0, "Rating"] = "n/a "
    table.loc[[5, 7], "Rating"] = -99
    table.to_csv(tmp_path / "a.csv", index=False)
    notes = read_answers([tmp_path / "a.csv"]).notes
    assert any("is a rating of -99 a missing answer? It is there 2 times" in n for n in notes)
    assert any("1 of 12 rows have no rating" in n for n in notes)
