"""Items of one element of a binary PLY file.

Items with the same lengths of lists have the same layout and are read together as one structured array.
"""

from copy import copy
from dataclasses import replace

import numpy as np

from fairing.errors import InputError
from fairing.mesh_formats.ply_header import Element, Property, values_of_corners


class BinaryItems:
    """The items of an element.

    Attributes:
        end: index of the first byte after them.
    """

    def __init__(self, element: Element, data: bytes, start: int, order: str) -> None:
        """Find the items in a file's bytes. `order` is "<" or ">".

        Raises:
            InputError: the file ends before the last declared item, or a list has a negative length.
        """
        self._element, self._order = element, order
        smallest = sum(np.dtype(p.count_type or p.type).itemsize for p in element.properties)
        if element.count * smallest > len(data) - start:
            raise self._truncated()
        records = self._alike(data, start)
        self._groups = [(np.arange(element.count), records)] if records is not None else self._walked(data, start)
        self.end = start + sum(records.nbytes for _, records in self._groups)

    def numbers(self, properties: list[Property]) -> np.ndarray:
        """(n, k) float64 of k single values."""
        values = np.empty((self._element.count, len(properties)))
        for rows, records in self._groups:
            for column, p in enumerate(properties):
                with np.errstate(invalid="ignore"):  # a signalling NaN, which the check of the mesh refuses
                    values[rows, column] = records[p.name]
        return values

    def lists(self, p: Property) -> tuple[np.ndarray, np.ndarray]:
        """The values of all lists, one after the other, and (n,) int64 their lengths."""
        lengths = np.zeros(self._element.count, dtype=np.int64)
        for rows, records in self._groups:
            lengths[rows] = records[p.name].shape[1]
        values = np.empty(lengths.sum(), dtype=np.dtype(p.type))
        starts = np.cumsum(lengths) - lengths
        for rows, records in self._groups:
            length = records[p.name].shape[1]
            values[starts[rows][:, None] + np.arange(length)] = records[p.name]
        return values, lengths

    def replaced(self, columns: dict[str, np.ndarray]) -> bytes:
        """The items with other single values, (n,) arrays by property; their types become the properties' types."""
        groups = []
        for rows, records in self._groups:
            lengths = self._lengths_of(records)
            types = {name: column.dtype.str[1:] for name, column in columns.items()}
            changed = np.empty(len(records), self._layout(lengths, types))
            for name in records.dtype.names or ():
                changed[name] = columns[name][rows] if name in columns else records[name]
            groups.append((rows, changed))
        if len(groups) == 1:
            return groups[0][1].tobytes()
        sizes = np.zeros(self._element.count, dtype=np.int64)
        for rows, records in groups:
            sizes[rows] = records.itemsize
        starts = np.cumsum(sizes) - sizes
        written = np.empty(sizes.sum(), dtype=np.uint8)
        for rows, records in groups:
            for i, column in enumerate(records.view(np.uint8).reshape(len(records), records.itemsize).T):
                written[starts[rows] + i] = column
        return written.tobytes()

    def cut(self, corners: Property, pieces: dict[int, np.ndarray]) -> "BinaryItems":
        """The items with some polygons as triangles, (t, 3) int places among their corners by index of the item.

        Lists with values for each corner are cut with it, and other properties repeated.
        """
        counts = np.ones(self._element.count, dtype=np.int64)
        counts[list(pieces)] = [len(triangles) for triangles in pieces.values()]
        first = np.cumsum(counts) - counts
        result = copy(self)
        result._element, result._groups = replace(self._element, count=int(counts.sum())), []
        for rows, records in self._groups:
            is_cut = np.isin(rows, list(pieces))
            result._groups.append((first[rows[~is_cut]], records[~is_cut]))
            for row, record in zip(rows[is_cut].tolist(), records[is_cut], strict=True):
                parts = self._cut(record, corners, pieces[row])
                result._groups.append((first[row] + np.arange(len(parts)), parts))
        return result

    def _cut(self, record: np.void, corners: Property, triangles: np.ndarray) -> np.ndarray:
        size, places = len(record[corners.name]), {}
        for p in self._element.properties:
            length = len(record[p.name]) if p.is_list else 1
            places[p.name] = values_of_corners(p.is_list, length, size, triangles)
        lengths = tuple(len(places[p.name][0]) for p in self._element.properties if p.is_list)
        parts = np.empty(len(triangles), self._layout(lengths))
        for p in self._element.properties:
            if p.is_list:
                parts[p.name] = [record[p.name][of_triangle] for of_triangle in places[p.name]]
                parts[f"length of {p.name}"] = len(places[p.name][0])
            else:
                parts[p.name] = record[p.name]
        return parts

    def _layout(self, lengths: tuple[int, ...], types: dict[str, str] | None = None) -> np.dtype:
        """Of an item whose lists have these lengths, with other types of single values by name."""
        fields: list[tuple] = []
        left = iter(lengths)
        for p in self._element.properties:
            if p.is_list:
                fields += [(f"length of {p.name}", self._order + p.count_type)]
                fields += [(p.name, self._order + p.type, (next(left),))]
            else:
                fields += [(p.name, self._order + (types or {}).get(p.name, p.type))]
        return np.dtype(fields)

    def _lengths_of(self, records: np.ndarray) -> tuple[int, ...]:
        return tuple(records[p.name].shape[1] for p in self._element.properties if p.is_list)

    def _alike(self, data: bytes, start: int) -> np.ndarray | None:
        """The items if all have the layout of the first one."""
        if not any(p.is_list for p in self._element.properties):
            return np.frombuffer(data, self._layout(()), self._element.count, start)
        if self._element.count == 0:
            return np.empty(0, self._layout((0,) * len(self._element.properties)))
        lengths, _ = self._item(data, start)
        layout = self._layout(lengths)
        if self._element.count * layout.itemsize > len(data) - start:
            return None
        records = np.frombuffer(data, layout, self._element.count, start)
        lists = (p.name for p in self._element.properties if p.is_list)
        are_alike = all(
            (records[f"length of {name}"] == length).all() for name, length in zip(lists, lengths, strict=True)
        )
        return records if are_alike else None

    def _walked(self, data: bytes, at: int) -> list[tuple[np.ndarray, np.ndarray]]:
        places: dict[tuple[int, ...], tuple[list[int], list[int]]] = {}
        for row in range(self._element.count):
            lengths, end = self._item(data, at)
            rows, starts = places.setdefault(lengths, ([], []))
            rows.append(row)
            starts.append(at)
            at = end
        whole = np.frombuffer(data, np.uint8)
        groups = []
        for lengths, (rows, starts) in places.items():
            layout = self._layout(lengths)
            items = np.lib.stride_tricks.sliding_window_view(whole, layout.itemsize)[starts]
            groups.append((np.array(rows), items.reshape(-1).view(layout)))
        return groups

    def _item(self, data: bytes, at: int) -> tuple[tuple[int, ...], int]:
        """The lengths of an item's lists, and the index of the first byte after the item."""
        lengths = []
        order = "little" if self._order == "<" else "big"
        for p in self._element.properties:
            size = int(p.type[1])
            if p.is_list:
                count_size = int(p.count_type[1])
                field = data[at : at + count_size]
                length = int.from_bytes(field, order, signed=p.count_type[0] == "i")
                if length < 0:
                    raise InputError(f"element {self._element.name}: expected lengths of lists, found {length}")
                lengths.append(length)
                at += count_size + length * size
            else:
                at += size
            if at > len(data):
                raise self._truncated()
        return tuple(lengths), at

    def _truncated(self) -> InputError:
        return InputError(
            f"element {self._element.name}: expected {self._element.count} items, found the end of the file before the "
            "last one; it is incomplete, export it again"
        )
