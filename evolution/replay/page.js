// Starts the bundled rerun viewer on the recording beside this page.
const status = document.getElementById("status");

function failed(error) {
  status.textContent =
    `The viewer could not start (${error}). It needs a recent browser, and the folder ` +
    "has to come from a web server: python -m http.server --bind 127.0.0.1";
}

async function show() {
  await wasm_bindgen({ module_or_path: "re_viewer_bg.wasm" });
  const handle = new wasm_bindgen.WebHandle({
    url: [new URL("replay.rrd", window.location).href],
    render_backend: new URLSearchParams(window.location.search).get("renderer"),
    hide_welcome_screen: true,
    persist: false,
    theme: "light",
  });
  await handle.start(document.getElementById("canvas"));
  status.textContent = "";
  // for whoever wants to know how it is
  window.viewer = handle;
}

show().catch(failed);
