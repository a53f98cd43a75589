"""Runs mediapipe's face networks on a stream of images, in an environment of their own.

`python mediapipe_runner.py` reads images from standard input and writes faces to standard output, until
its input ends. It imports mediapipe, OpenCV and numpy alone: its environment has another numpy than
Vermilion's. All integers and floats are little-endian:

    once, out:     b"VMP1"
    an image, in:  uint32 height, width, greatest number of faces; height * width * 3 bytes of RGB
    answer, out:   uint32 number of faces, the largest first; for each float32 presence, then twice
                   478 * 3 float32: the points found in the image, and those found in its mirror image
                   and mirrored back (point k of these lies across the face from point k of the others)

x and y are in pixels of the image, the centre of the top-left pixel is (0.5, 0.5); z has the same unit
and grows away from the camera. Every image is worked on by itself: faces are detected anew and nothing
is carried over, so that an answer depends on the image alone. `--check` runs one blank image.
"""

from __future__ import annotations

import os
import struct
import sys

import cv2
import numpy as np

MAGIC = b"VMP1"
SIDE = 192  # pixels of the landmark network's input
MARGIN = 1.5  # side of its crop, in sides of the box round the face
#: Crops whose answers are averaged, in sides of the usual one: 0.15 px less error at a mouth of 120 px
#: than one crop, and less jitter.
SIZES = (0.9, 1.1)
LOCATING = 2  # crops before these, which place them: the first about what the detector saw
PRESENCE = 0.5  # least probability that a crop shows a face
N_MESH = 468  # points of the face; the irises follow, and do not count for the box
EYE_CORNERS = (33, 263)  # outer corners: the line between them is level in the crop
OVERLAP = 0.3  # intersection over union of two boxes that are the same face
TILES = (0.5, 0.25)  # sides of the tiles where small faces are looked for, in sides of the image


class FaceMesh:
    """The attention mesh: 478 points from a crop of a face."""

    def __init__(self):
        from mediapipe.framework import calculator_pb2
        from mediapipe.python import packet_creator, packet_getter
        from mediapipe.python._framework_bindings import calculator_graph

        config = calculator_pb2.CalculatorGraphConfig()
        config.ParseFromString(_landmark_graph().binary_config)
        self._score = _report_every_score(config)
        self._graph = calculator_graph.CalculatorGraph(graph_config=config)
        self._found, self._stamp = {}, 0
        readers = {"landmarks": packet_getter.get_proto, self._score: packet_getter.get_float}
        for name, read in readers.items():
            self._graph.observe_output_stream(name, self._keeper(read))
        self._graph.start_run({"with_attention": packet_creator.create_bool(True)})

    def _keeper(self, read):
        return lambda name, packet: self._found.update({name: read(packet)})

    def __call__(self, crop: np.ndarray) -> tuple[np.ndarray, float]:
        """Points (478, 3) in pixels of a crop (192, 192, 3) uint8 RGB, and the presence of a face."""
        from mediapipe.framework.formats import rect_pb2
        from mediapipe.python._framework_bindings.image_frame import ImageFormat, ImageFrame
        from mediapipe.python.packet_creator import create_image_frame, create_proto

        self._found.clear()
        self._stamp += 1
        frame = ImageFrame(ImageFormat.SRGB, data=np.ascontiguousarray(crop))
        whole = rect_pb2.NormalizedRect(x_center=0.5, y_center=0.5, width=1.0, height=1.0)
        packets = {"image": create_image_frame(frame), "roi": create_proto(whole)}
        for name, packet in packets.items():
            self._graph.add_packet_to_input_stream(name, packet.at(self._stamp))
        self._graph.wait_until_idle()
        points = [(p.x, p.y, p.z) for p in self._found["landmarks"].landmark]
        return np.array(points) * SIDE, float(self._found[self._score])


def _landmark_graph():
    """The wheel's graph of the landmark network, with a crop in place of its detector and tracker."""
    import mediapipe
    from google.protobuf import text_format
    from mediapipe.framework import calculator_pb2
    from mediapipe.python._framework_bindings import calculator_graph, resource_util

    resource_util.set_resource_dir(os.path.dirname(os.path.dirname(mediapipe.__file__)))
    text = """
        input_stream: "image" input_stream: "roi" input_side_packet: "with_attention"
        node {
            calculator: "FaceLandmarkCpu"
            input_stream: "IMAGE:image" input_stream: "ROI:roi"
            input_side_packet: "WITH_ATTENTION:with_attention"
            output_stream: "LANDMARKS:landmarks"
        }"""
    config = text_format.Parse(text, calculator_pb2.CalculatorGraphConfig())
    return calculator_graph.CalculatorGraph(graph_config=config)


def _report_every_score(config) -> str:
    """Let landmarks out whatever their score, on one thread; the name of the score's stream."""
    from mediapipe.calculators.tensor import inference_calculator_pb2
    from mediapipe.calculators.util import thresholding_calculator_pb2

    score = ""
    for node in config.node:
        if node.calculator == "InferenceCalculatorCpu":
            key = inference_calculator_pb2.InferenceCalculatorOptions.ext
            node.options.Extensions[key].delegate.xnnpack.num_threads = 1
        elif node.calculator == "ThresholdingCalculator":
            key = thresholding_calculator_pb2.ThresholdingCalculatorOptions.ext
            node.options.Extensions[key].threshold = -1.0
        elif node.calculator == "TensorsToFloatsCalculator":
            score = node.output_stream[0].split(":")[-1]
    del config.executor[:]
    config.num_threads = 1
    return score


class FaceDetector:
    """Faces in an image: near ones and, in tiles, small ones."""

    def __init__(self):
        from mediapipe.python.solutions.face_detection import FaceDetection

        self._far = FaceDetection(model_selection=1, min_detection_confidence=0.5)
        self._near = FaceDetection(model_selection=0, min_detection_confidence=0.5)

    def __call__(self, image: np.ndarray) -> list[np.ndarray]:
        """Squares (x, y, side, angle) round the faces, px and radians, the largest first."""
        found = self._in(self._far, image) or self._in(self._near, image)
        for share in TILES:
            if found:
                break
            for x, y, side in _tiles(image.shape, share):
                tile = np.ascontiguousarray(image[y : y + side, x : x + side])
                shift = np.array([x, y, 0, 0])
                found += [box + shift for box in self._in(self._far, tile)]
        return sorted(found, key=lambda box: -box[2])

    def _in(self, detector, image: np.ndarray) -> list[np.ndarray]:
        height, width = image.shape[:2]
        boxes = []
        for detection in detector.process(image).detections or []:
            place = detection.location_data
            box, eyes = place.relative_bounding_box, place.relative_keypoints[:2]
            turn = np.arctan2((eyes[1].y - eyes[0].y) * height, (eyes[1].x - eyes[0].x) * width)
            x, y = (box.xmin + box.width / 2) * width, (box.ymin + box.height / 2) * height
            side = max(box.width * width, box.height * height)
            boxes.append(np.array([x, y, side, turn]))
        return boxes


def _tiles(shape, share: float) -> list[tuple[int, int, int]]:
    """Squares (left, top, side) that overlap by half, of a share of the image's longer side."""
    height, width = shape[:2]
    side = min(int(max(height, width) * share), height, width)
    if side < 48:
        return []

    def starts(length):
        count = 1 + int(np.ceil((length - side) / (side / 2)))
        return np.linspace(0, length - side, count).round().astype(int)

    return [(x, y, side) for y in starts(height) for x in starts(width)]


class FaceFinder:
    """The landmarks of the faces of an image."""

    def __init__(self):
        self._mesh, self._detector = FaceMesh(), FaceDetector()

    def __call__(self, image: np.ndarray, max_faces: int) -> list[tuple[float, np.ndarray]]:
        """Presence and points (2, 478, 3) of each face in an image (h, w, 3) uint8 RGB."""
        faces: list[tuple[float, np.ndarray]] = []
        boxes: list[np.ndarray] = []
        for seen in self._detector(image):
            if len(faces) >= max_faces:
                break
            box = seen
            for _ in range(LOCATING):
                points, _, presence = self._look(image, box, mirrored=False)
                box = _square_round(points)
            if presence < PRESENCE or any(_overlap(box, other) > OVERLAP for other in boxes):
                continue
            looks = [self._look(image, box * [1, 1, size, 1]) for size in SIZES]
            presence = min(look[2] for look in looks)
            if presence < PRESENCE:
                continue
            faces.append((presence, np.mean([np.stack(look[:2]) for look in looks], axis=0)))
            boxes.append(box)
        return faces

    def _look(self, image: np.ndarray, box: np.ndarray, mirrored: bool = True):
        """Points (478, 3) in a crop about a box, those in the crop's mirror image, and presence."""
        matrix = _image_from_crop(box)
        crop = _crop(image, matrix)
        points, presence = self._mesh(crop)
        across = np.zeros_like(points)
        if mirrored:
            across, _ = self._mesh(crop[:, ::-1])
            across[:, 0] = SIDE - across[:, 0]
        return _into_image(points, matrix), _into_image(across, matrix), presence


def _image_from_crop(box: np.ndarray) -> np.ndarray:
    """The similarity (2, 3) from pixels of the crop to those of the image."""
    x, y, side, turn = box
    scale = side * MARGIN / SIDE
    matrix = scale * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    shift = np.array([x, y]) - matrix @ [SIDE / 2, SIDE / 2]
    return np.concatenate([matrix, shift[:, None]], axis=1)


def _crop(image: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """The crop (192, 192, 3); an image that is much finer is averaged first."""
    shrink = max(1, round(float(np.hypot(*matrix[:, 0]))))
    limit = [image.shape[1], image.shape[0]]
    corners = matrix @ np.array([[0, 0, SIDE, SIDE], [0, SIDE, 0, SIDE], [1, 1, 1, 1]])
    low = np.clip(np.floor(corners.min(axis=1)).astype(int) - shrink, 0, limit) // shrink * shrink
    high = np.clip(np.ceil(corners.max(axis=1)).astype(int) + shrink, 0, limit)
    size = (high - low) // shrink
    if shrink > 1 and size.min() > 0:
        high = low + size * shrink
        piece = image[low[1] : high[1], low[0] : high[0]]
        image = cv2.resize(piece, tuple(size.tolist()), interpolation=cv2.INTER_AREA)
        matrix = (matrix - np.column_stack([np.zeros((2, 2)), low])) / shrink
    # OpenCV counts from the centre of the top-left pixel.
    shift = matrix[:, :2] @ [0.5, 0.5] - 0.5
    return cv2.warpAffine(
        image,
        matrix + np.column_stack([np.zeros((2, 2)), shift]),
        (SIDE, SIDE),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )


def _into_image(points: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Points (478, 3) of the crop in pixels of the image."""
    scale = np.hypot(*matrix[:, 0])
    xy = points[:, :2] @ matrix[:, :2].T + matrix[:, 2]
    return np.concatenate([xy, scale * points[:, 2:]], axis=1)


def _square_round(points: np.ndarray) -> np.ndarray:
    """The square (x, y, side, angle) about a face's points (478, 3), level with its eyes."""
    right, left = points[list(EYE_CORNERS), :2]
    turn = np.arctan2(left[1] - right[1], left[0] - right[0])
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    level = points[:N_MESH, :2] @ axes
    low, high = level.min(axis=0), level.max(axis=0)
    centre = axes @ ((low + high) / 2)
    return np.array([*centre, (high - low).max(), turn])


def _overlap(a: np.ndarray, b: np.ndarray) -> float:
    """Intersection over union of two squares, as if they were level."""
    low = np.maximum(a[:2] - a[2] / 2, b[:2] - b[2] / 2)
    high = np.minimum(a[:2] + a[2] / 2, b[:2] + b[2] / 2)
    common = np.prod(np.maximum(high - low, 0))
    return float(common / (a[2] ** 2 + b[2] ** 2 - common))


def serve(source, sink) -> None:
    """Answer images until `source`, whose `read` waits for all bytes, ends."""
    finder = FaceFinder()
    sink.write(MAGIC)
    sink.flush()
    while len(header := source.read(12)) == 12:
        height, width, max_faces = struct.unpack("<3I", header)
        pixels = source.read(height * width * 3)
        if len(pixels) < height * width * 3:
            return
        image = np.frombuffer(pixels, dtype=np.uint8).reshape(height, width, 3)
        faces = finder(image, max_faces)
        sink.write(struct.pack("<I", len(faces)))
        for presence, points in faces:
            sink.write(struct.pack("<f", presence) + points.astype("<f4").tobytes())
        sink.flush()


def main() -> None:
    if "--check" in sys.argv[1:]:
        faces = FaceFinder()(np.zeros((96, 128, 3), dtype=np.uint8), 1)
        if faces:
            sys.exit("a blank image has a face")
        return
    # The answers get a channel of their own: what a library prints must not come between.
    sink = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    serve(sys.stdin.buffer, sink)


if __name__ == "__main__":
    cv2.setNumThreads(1)
    main()
