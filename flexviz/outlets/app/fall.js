// An effect has been added: residual, errors, links and the last bar of the staircase move from the model before to the
// present one. The page has the present one at once; in between, what it shows is mixed of both.
// --fv-fall of the style sheet is how long that takes; none under reduced motion.
if (!window.flexvizFall) {
  const HOLD = 0.25;  // of the time in which the model before is still shown: the tab may turn meanwhile
  const LONGEST = 100;  // [ms] between two pictures that count: a slow page falls later instead of at one blow
  const WATCH = 100;  // [ms]
  const viser = window.flexvizViser;
  const state = window.flexvizFall = { count: null, clock: 0, last: null, running: false };
  const before = new Map();  // what the page showed: numbers and colours, by their names
  const all = mark => [...document.querySelectorAll(`[${mark}]`)];
  const length = () => 1000 * parseFloat(getComputedStyle(document.documentElement).getPropertyValue('--fv-fall')) || 0;

  const links = () => {  // materials of the links by their name
    const nodes = viser.nodes();
    return Object.keys(nodes).filter(name => nodes[name] && /^\/(measured|identified)\/[^/]+$/.test(name))
      .map(name => [name, nodes[name].children.find(one => one.isMesh && one.material.color)])
      .filter(([, mesh]) => mesh).map(([name, mesh]) => [name, mesh.material]);
  };
  const remember = () => {
    if (state.running) return;
    before.clear();
    all('data-fv-count').forEach(one => before.set(one.dataset.fvCount, parseFloat(one.textContent)));
    all('data-fv-fade').forEach(one => before.set(one.dataset.fvFade, one.style.background));
    links().forEach(([name, material]) => before.set(name, material.color.clone()));
  };

  // a chart with the residual before: that is where the present one begins
  const mixed = new Map();  // chart -> its data and how it takes new ones
  const mix = (chart, data, share) => {
    const [from, to] = ['BEFORE', 'RESIDUAL'].map(label => chart.series.findIndex(one => one.label === label));
    if (from < 0 || to < 0) return data;
    return data.map((column, k) => (k === to ? column.map((y, i) => data[from][i] + share * (y - data[from][i])) : column));
  };
  const residuals = share => {
    for (const chart of viser.charts()) {
      if (mixed.has(chart) || !chart.series.some(one => one.label === 'BEFORE')) continue;
      const known = { data: chart.data, set: chart.setData };
      chart.setData = (data, ...more) => {  // the playhead moves on
        known.data = data;
        known.set(mix(chart, data, state.share), ...more);
      };
      mixed.set(chart, known);
    }
    mixed.forEach((known, chart) => {
      known.set(mix(chart, known.data, share), false);
      chart.redraw();
    });
  };
  const numbers = share => all('data-fv-count').forEach(one => {
    const from = before.get(one.dataset.fvCount);
    one.fvText = one.fvText || one.textContent;
    const to = parseFloat(one.fvText), between = from + share * (to - from);
    const digits = between < 999.5 ? between.toPrecision(3) : String(Math.round(between));
    const text = share < 1 && Number.isFinite(between) ? digits : one.fvText;
    if (one.textContent !== text) one.textContent = text;  // else the observer below would see a change each time
  });
  const colours = share => {
    all('data-fv-fade').forEach(one => {
      const from = before.get(one.dataset.fvFade);
      one.fvColour = one.fvColour || one.style.background;
      one.style.background = from && share < 1 ? `color-mix(in srgb, ${one.fvColour} ${100 * share}%, ${from})` : one.fvColour;
    });
    links().forEach(([name, material]) => {
      const { color } = material, from = before.get(name);
      if (!material.fvMixed || !color.equals(material.fvMixed)) material.fvColour = color.clone();  // by the program
      if (from) color.lerpColors(from, material.fvColour, share);
      material.fvMixed = color.clone();
    });
    if (viser.scene().requestRender) viser.scene().requestRender();
  };
  const bars = share => {
    const rows = [...document.querySelectorAll('.fv-stair')], row = rows.at(-1), from = rows.at(-2);
    [...(from ? row.querySelectorAll('span') : [])].forEach((bar, k) => {
      bar.fvWidth = bar.fvWidth || bar.style.width;
      const [then, now] = [from.children[k].style.width, bar.fvWidth].map(parseFloat);
      bar.style.width = share < 1 ? `${then + share * (now - then)}%` : bar.fvWidth;
      bar.style.transform = share < 1 ? `scaleY(${Math.min(4 * share, 1)})` : '';
    });
  };
  const show = share => {
    state.share = share;
    [residuals, numbers, colours, bars].forEach(part => part(share));
  };

  const step = time => {
    const whole = length();
    state.clock += state.last === null ? 0 : Math.min(time - state.last, LONGEST);
    state.last = time;
    const way = Math.min(Math.max(state.clock / whole - HOLD, 0) / (1 - HOLD), 1);
    show(whole > 0 ? (1 - Math.cos(Math.PI * way)) / 2 : 1);
    if (state.share < 1) {
      requestAnimationFrame(step);
      return;
    }
    mixed.forEach((known, chart) => { chart.setData = known.set; });
    mixed.clear();
    state.running = false;
  };
  new MutationObserver(() => {
    if (state.running) numbers(state.share);  // a text that comes meanwhile is the present model's
    const now = (document.querySelector('[data-fv-fall]') || { dataset: {} }).dataset.fvFall;
    if (now === undefined || now === state.count) return;
    const first = state.count === null;
    state.count = now;
    if (first || length() === 0) return;
    Object.assign(state, { clock: 0, last: null });
    if (state.running) return;
    state.running = true;
    show(0);
    requestAnimationFrame(step);
  }).observe(document.documentElement, { childList: true, subtree: true });
  setInterval(remember, WATCH);
}
