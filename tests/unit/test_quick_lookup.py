"""Snakemake's look-up of producers is remembered, file by file, and gives the same."""

from snakemake.output_index import OutputIndex

from vermilion.app.quick_lookup import remember_producers


class Index:
    """As Snakemake's, with a count of the questions."""

    def __init__(self, producers):
        self.producers, self.asked = producers, []

    def match_producers(self, targetfile):
        self.asked.append(targetfile)
        return {rule for rule, start in self.producers.items() if targetfile.startswith(start)}


def test_each_file_is_looked_up_once_and_by_each_index_for_itself():
    class Remembering(Index):
        match_producers = Index.match_producers

    remember_producers(Remembering)
    remember_producers(Remembering)  # once is enough
    one = Remembering({"fit": "takes/", "train": "models/"})
    other = Remembering({"fit": "elsewhere/"})
    for _ in range(3):
        assert one.match_producers("takes/a.npz") == {"fit"}
        assert one.match_producers("captures/0.png") == set()
        assert other.match_producers("takes/a.npz") == set()
    assert one.asked == ["takes/a.npz", "captures/0.png"] and other.asked == ["takes/a.npz"]


def test_snakemake_still_has_the_name():
    assert callable(OutputIndex.match_producers)


def test_another_snakemake_is_left_alone():
    class Other:
        pass

    remember_producers(Other)
    assert not hasattr(Other, "match_producers")
