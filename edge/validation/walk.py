"""Index of a file that was not closed, is damaged, or has no index: its records are walked."""

from __future__ import annotations

from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema

from edge.recording.chunk import ChunkDamaged, ChunkHeader, Contents, chunk_body, chunk_header, contents
from edge.recording.scan import Record, parse
from edge.recording.survey import ChunkPiece, DamagePiece, EndPiece, LoosePiece, agrees, indexed, survey
from edge.validation.series import Gather


class WalkedIndex(Gather):
    """A file that was not closed, is damaged, or has no index."""

    def read(self) -> None:
        self.schemas, self.channels = {}, {}
        self.index.attachments = 0
        for piece in survey(self.file):
            match piece:
                case ChunkPiece():
                    self._chunk(piece)
                case LoosePiece(record=record):
                    self._loose(record)
                case DamagePiece():
                    self.index.damages.append(f"{piece.end - piece.offset:,} unreadable bytes at byte {piece.offset:,}")
                case EndPiece() if not piece.finished and piece.offset < self.file.size:
                    self.index.damages.append(f"its last {self.file.size - piece.offset:,} bytes are cut off")
        self.finish()

    def _chunk(self, piece: ChunkPiece) -> None:
        header = chunk_header(self.file, piece.record)
        ordinal = self.count_chunk(piece.record, header.compression)
        index = indexed(self.file, piece.indexes)
        if index and all(channel in self.channels for channel in index) and agrees(index, header):
            self.add_contents(Contents(index=index), ordinal)
            return
        self._body(piece, header, ordinal)

    def _body(self, piece: ChunkPiece, header: ChunkHeader, ordinal: int) -> None:
        try:
            self.add_contents(contents(chunk_body(self.file, header)), ordinal)
        except ChunkDamaged as damage:
            self.index.damages.append(f"a chunk at byte {piece.record.offset:,}: {damage}")

    def _loose(self, record: Record) -> None:
        if record.opcode == Opcode.MESSAGE:
            head = self.file.read(record.content, 14)
            entry = head[6:14] + record.offset.to_bytes(8, "little")
            self.add_entries(int.from_bytes(head[:2], "little"), entry, -1)
        elif record.opcode == Opcode.ATTACHMENT:
            self.index.attachments += 1
        elif record.opcode in {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA}:
            kinds = {Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel, Opcode.METADATA: Metadata}
            match parse(self.file, record, kinds[Opcode(record.opcode)]):
                case Schema() as schema:
                    self.schemas[schema.id] = schema
                case Channel() as channel:
                    self.channels[channel.id] = channel
                case Metadata() as metadata:
                    self.add_metadata(metadata)
