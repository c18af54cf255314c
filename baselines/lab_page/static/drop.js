// Files and whole folders, dropped or chosen; each is sent to this machine's own server, one after the other.
async function walk(entry, path, found) {
  if (entry.isFile) {
    found.push([path + entry.name, await new Promise((done, fail) => entry.file(done, fail))]);
    return;
  }
  const reader = entry.createReader();
  for (;;) {
    const some = await new Promise((done, fail) => reader.readEntries(done, fail));
    if (!some.length) return;
    for (const inside of some) await walk(inside, path + entry.name + "/", found);
  }
}

export default {
  template: `
    <div class="lab-drop" :class="{ 'lab-over': over }" @dragover.prevent="over = true" @dragleave="over = false" @drop.prevent="dropped">
      <p>{{ texts.drop }}</p>
      <button type="button" @click="$refs.files.click()">{{ texts.files }}</button>
      <button type="button" @click="$refs.folder.click()" v-if="folders">{{ texts.folder }}</button>
      <input ref="files" type="file" :multiple="folders" hidden @change="chosen" :accept="accept">
      <input ref="folder" type="file" webkitdirectory hidden @change="chosen">
      <p v-if="busy" role="status">{{ busy }}</p>
    </div>`,
  props: { url: String, texts: Object, accept: String, folders: Boolean },
  emits: ["sent", "refused"],
  data() { return { over: false, busy: "" }; },
  methods: {
    async dropped(e) {
      this.over = false;
      const found = [], entries = [...e.dataTransfer.items].map((i) => i.webkitGetAsEntry && i.webkitGetAsEntry()).filter(Boolean);
      for (const entry of entries) await walk(entry, "", found);
      if (!entries.length) for (const f of e.dataTransfer.files) found.push([f.name, f]);
      await this.send(found);
    },
    async chosen(e) {
      await this.send([...e.target.files].map((f) => [f.webkitRelativePath || f.name, f]));
      e.target.value = "";
    },
    async send(found) {
      const refused = [];
      let taken = 0;
      for (const [name, file] of found) {
        if (name.split("/").some((part) => part.startsWith("."))) continue;
        this.busy = `${++taken} / ${found.length}  ${name}`;
        try {
          const answer = await fetch((window.path_prefix || "") + this.url + "?name=" + encodeURIComponent(name), { method: "POST", body: file });
          if (!answer.ok) refused.push(await answer.text());
        } catch (error) { refused.push(name + ": " + error); }
      }
      this.busy = "";
      this.$emit("sent", { refused });
    },
  },
};
