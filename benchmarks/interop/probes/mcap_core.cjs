// `mcap_core.cjs FILE...` with NODE_PATH at the modules: messages by topic as the indexed reader gives them, as JSON.
const { open } = require("node:fs/promises");
const { McapIndexedReader } = require("@mcap/core");

async function count(path, counts) {
  const file = await open(path);
  const readable = {
    size: async () => BigInt((await file.stat()).size),
    read: async (offset, length) => {
      const bytes = new Uint8Array(Number(length));
      await file.read(bytes, 0, bytes.length, Number(offset));
      return bytes;
    },
  };
  const reader = await McapIndexedReader.Initialize({ readable });
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    const { topic } = reader.channelsById.get(message.channelId);
    counts[topic] = (counts[topic] ?? 0) + 1;
  }
  await file.close();
}

(async () => {
  const counts = {};
  for (const path of process.argv.slice(2)) {
    await count(path, counts);
  }
  console.log(JSON.stringify(counts));
})();
