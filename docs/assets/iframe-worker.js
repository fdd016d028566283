/* Browsers start no worker from a page that was opened from the disk: an iframe does the worker's part there. */
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super()
      this.onmessage = null
      this.waiting = []
      const frame = document.createElement("iframe")
      frame.hidden = true
      frame.title = "search"
      document.body.appendChild(frame)
      const inner = frame.contentWindow
      inner.postMessage = data => {
        const event = new MessageEvent("message", { data })
        this.dispatchEvent(event)
        if (this.onmessage) this.onmessage(event)
      }
      inner.importScripts = (...urls) => Promise.all(urls.map(source => load(inner, source)))
      load(inner, url).then(() => {
        this.inner = inner
        this.waiting.splice(0).forEach(data => this.postMessage(data))
      })
    }
    postMessage(data) {
      if (!this.inner) this.waiting.push(data)
      else this.inner.dispatchEvent(new MessageEvent("message", { data }))
    }
    terminate() {}
  }
  const load = (inner, source) => new Promise((done, failed) => {
    const script = inner.document.createElement("script")
    script.src = new URL(source, location.href).href
    script.onload = done
    script.onerror = failed
    inner.document.head.appendChild(script)
  })
}
