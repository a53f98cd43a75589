"""Files of a bucket: the path of a local copy follows the address, folders are found once they are there."""

from copy import copy

from vermilion.app.bucket_files import mend_bucket_files


def files_of_plugin():
    """A class that keeps what the plugin's keeps: path and kind, as they were when it was made."""

    class StorageObject:
        stored = ()

        def __init__(self, query):
            self.query, self._suffix, self._is_dir = query, query[len("s3://") :], None

        def local_suffix(self):
            return self._suffix

        def get_subkeys(self):
            return iter(self.stored)

        def is_dir(self):
            if self._is_dir is None:
                self._is_dir = any(self.get_subkeys())
            return self._is_dir

    return StorageObject


def test_constraints_that_are_added_to_an_address_are_in_the_path():
    kind = files_of_plugin()
    output = copy(kind("s3://facility/results/{chunk}.npz"))
    output.query = r"s3://facility/results/{chunk,\d+}.npz"
    assert output.local_suffix() == "facility/results/{chunk}.npz"
    mend_bucket_files(kind)
    assert output.local_suffix() == r"facility/results/{chunk,\d+}.npz"


def test_a_folder_that_was_stored_after_planning_is_found():
    found = []
    for mended in (False, True):
        kind = files_of_plugin()
        if mended:
            mend_bucket_files(kind)
        folder = kind("s3://facility/results/cameras")
        assert not folder.is_dir()
        folder.stored = ("cameras.txt",)
        found.append(folder.is_dir())
    assert found == [False, True]


def test_a_plugin_without_folders_is_left_alone():
    class StorageObject:
        query = "az://account/results/measures.tsv"

    mend_bucket_files(StorageObject)
    assert StorageObject().local_suffix() == "account/results/measures.tsv"
    assert not hasattr(StorageObject, "is_dir")
