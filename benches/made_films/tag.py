"""A printed tag beside the tree (AprilTag 36h11), which hangs still. Pixels."""
import cv2
import numpy as np

from .picture import FINE, HEIGHT, WIDTH

ID, CELLS = 7, 10  # its number; cells along a side with the white rim
CELL_PX = 4.5  # its black square is 36 px: of a film with depth 0.137 m, else 0.16 m by --tag 0.16
OFF_EDGE_PX = 14.0


def place(reach_px):
    """Its upper left corner on the side of the tree that has more room, as high as the ground's far edge; `reach_px` are the
    corners of the box that the tree never leaves."""
    (left, _), (right, _) = reach_px
    side = CELLS * CELL_PX
    u = OFF_EDGE_PX if left > WIDTH - right else WIDTH - OFF_EDGE_PX - side
    return np.array([u + 0.3, 0.62 * HEIGHT + 0.6])


def paint(image, corner_px):
    """Draws it over an image, by the share of each pixel that it covers."""
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    inner = cv2.aruco.generateImageMarker(family, ID, 8)
    cells = np.pad(np.where(inner > 127, 225.0, 25.0), 1, constant_values=225.0)
    side = round(CELLS * CELL_PX * FINE)
    fine = cv2.resize(cells, (side, side), interpolation=cv2.INTER_NEAREST)
    low = np.floor(corner_px).astype(int)
    n = int(np.ceil(CELLS * CELL_PX)) + 2
    value, cover = np.zeros((FINE * n, FINE * n)), np.zeros((FINE * n, FINE * n))
    off = np.round(FINE * (corner_px - low)).astype(int)
    box = np.s_[off[1] : off[1] + side, off[0] : off[0] + side]
    value[box], cover[box] = fine, 1.0
    value, cover = (cv2.resize(x, (n, n), interpolation=cv2.INTER_AREA)[..., None] for x in (value, cover))
    part = image[low[1] : low[1] + n, low[0] : low[0] + n]
    part[:] = value + (1 - cover) * part
