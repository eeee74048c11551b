// What viser reports to no program: clicks into plots, zooming them, the link under the pointer. What it lacks: a button
// at every plot, small numbers in plots, tooltips that close.
// The values go into the page's own controls, as if they had been typed, and are checked there.
if (!window.flexvizPage) {
  const viser = window.flexvizViser, own = window.flexvizPage = {};  // what layout.js uses, too
  const asksForDark = new URLSearchParams(window.location.search).has('darkMode');  // and viser shows nothing else
  document.documentElement.classList.toggle('fv-dark', asksForDark);
  const CLICK = 4;  // [px] a press may move; more is a drag, which zooms
  const over = e => (e.target.closest ? e.target.closest('.u-over') : null);
  const timed = place => viser.charts().find(one => one.over === place && one.series[0].label === 'AXIS');
  const type = (input, text) => {
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set.call(input, text);
    input.dispatchEvent(new Event('input', { bubbles: true }));
  };
  const inputs = name => {
    const label = [...document.querySelectorAll('label')].find(one => one.textContent.trim() === name);
    const row = label && viser.control(label);
    return row ? [...row.querySelectorAll('input:not([type=hidden])')] : [];
  };

  const page = Math.random().toString(36).slice(2, 10);  // browsers must not write the same text twice
  let told = 0;
  // viser sends only the last of what all controls change within 50 ms: what the page reports by itself waits for the
  // user, and a text that was typed is sent once more when it is left
  const QUIET = 100;  // [ms]
  let used = -QUIET;
  for (const kind of ['input', 'keydown', 'pointerdown', 'pointermove', 'pointerup']) {
    window.addEventListener(kind, e => { if (kind !== 'pointermove' || e.buttons) used = performance.now(); }, true);
  }
  own.quiet = () => performance.now() - used > QUIET;
  document.addEventListener('focusout', e => {
    const control = viser.typed(e.target);
    if (control) viser.send(control, e.target.value);
  }, true);
  own.tell = (label, text) => inputs(label).slice(0, 1).forEach(input => type(input, `${page}.${told += 1} ${text}`));

  let down = null;
  document.addEventListener('mousedown', e => {
    const place = over(e);
    down = place ? { place, x: e.clientX, y: e.clientY } : null;
  }, true);
  document.addEventListener('mouseup', e => {
    const from = down, chart = from && timed(from.place);
    down = null;
    if (!chart) return;
    const left = from.place.getBoundingClientRect().left;
    const [first, last] = [from.x, e.clientX].map(x => chart.posToVal(x - left, 'x')).sort((a, b) => a - b);
    if (Math.hypot(e.clientX - from.x, e.clientY - from.y) <= CLICK) {
      own.tell('TRANSPORT', `seek ${last.toFixed(2)}`);
    } else if (Math.abs(e.clientX - from.x) > CLICK) {
      own.tell('TRANSPORT', `span ${first.toFixed(2)} – ${last.toFixed(2)}`);
    }
  }, true);
  document.addEventListener('dblclick', e => {
    if (over(e) && timed(over(e))) own.tell('TRANSPORT', 'span all');
  }, true);

  document.addEventListener('click', e => {
    const row = e.target.closest ? e.target.closest('tr[data-fleet]') : null;
    const open = row && [...document.querySelectorAll('button')].find(one => one.textContent.trim() === 'OPEN');
    if (!open) return;
    inputs('NUMBER').slice(0, 1).forEach(input => type(input, row.dataset.fleet));
    setTimeout(() => open.click(), 150);  // the press must not overtake the number
  }, true);

  // a pole follows the pointer: its picture is drawn anew meanwhile, but its frame stays
  let pole = null, drags = 0;
  const placed = e => {
    const box = document.querySelector('.fv-poles').getBoundingClientRect();
    const { width, height } = document.querySelector('.fv-poles').viewBox.baseVal;
    return [((e.clientX - box.left) * width) / box.width, ((e.clientY - box.top) * height) / box.height];
  };
  document.addEventListener('pointerdown', e => {
    const grip = e.target.closest ? e.target.closest('[data-pole]') : null;
    if (!grip) return;
    e.preventDefault();  // selects no text
    drags += 1;
    pole = { name: `${drags} ${grip.dataset.pole}`, at: null };
  }, true);
  document.addEventListener('pointermove', e => {
    if (!pole || !document.querySelector('.fv-poles')) return;
    if (!pole.at) setTimeout(() => {
      if (pole && pole.at) inputs('POLE').slice(0, 1).forEach(input => type(input, pole.at));
      if (pole) pole.at = null;
    }, 40);  // [ms] what is between two pictures is not sent
    pole.at = `${pole.name} ${placed(e).map(one => one.toFixed(1)).join(' ')}`;
  }, true);
  document.addEventListener('pointerup', () => {
    if (pole && pole.at) inputs('POLE').slice(0, 1).forEach(input => type(input, pole.at));
    pole = null;
  }, true);

  // files dropped anywhere, or several chosen at once, go one after the other into the page's own upload
  const wait = time => new Promise(done => setTimeout(done, time));
  let drops = 0, sending = Promise.resolve();
  const send = async files => {
    const button = [...document.querySelectorAll('button')].find(one => one.textContent.trim() === 'DROP');
    const input = button && viser.upload(button);
    if (!input) return;
    const good = files.filter(file => file.size > 0 && file.size <= LARGEST_UPLOAD);
    const skipped = files.filter(file => !good.includes(file)).slice(0, 10).map(file => [file.name.slice(0, 60), file.size]);
    drops += 1;
    inputs('COMING').slice(0, 1).forEach(one => type(one, JSON.stringify({ drop: drops, files: good.length, skipped })));
    await wait(250);  // the files must not overtake their number
    for (const file of good) {
      const one = new DataTransfer();
      one.items.add(file);
      input.files = one.files;
      input.dispatchEvent(new Event('change', { bubbles: true }));
      do await wait(100); while (button.disabled);  // until the server has all of it
    }
  };
  const queue = files => { sending = sending.then(() => send(files)).catch(() => {}); };
  const inside = async entry => {  // the files of a dropped folder
    if (entry.name.startsWith('.')) return [];
    if (entry.isFile) return [await new Promise((done, failed) => entry.file(done, failed))];
    const reader = entry.createReader(), found = [];
    for (;;) {
      const some = await new Promise((done, failed) => reader.readEntries(done, failed));
      if (!some.length) return (await Promise.all(found.map(inside))).flat();
      found.push(...some);
    }
  };
  const shade = document.createElement('div');
  shade.className = 'fv-drop';
  shade.style.display = 'none';
  shade.innerHTML = '<b>Drop a URDF and logs</b><small>or a measurement set, or a session</small>';
  document.body.append(shade);
  const carries = e => e.dataTransfer && [...e.dataTransfer.types].includes('Files');
  document.addEventListener('dragover', e => {
    if (!carries(e)) return;
    e.preventDefault();
    shade.style.display = '';
  }, true);
  document.addEventListener('dragleave', e => { if (!e.relatedTarget) shade.style.display = 'none'; }, true);
  document.addEventListener('drop', e => {
    if (!carries(e)) return;
    e.preventDefault();
    e.stopPropagation();
    shade.style.display = 'none';
    const entries = [...e.dataTransfer.items].map(item => item.webkitGetAsEntry && item.webkitGetAsEntry());
    const files = [...e.dataTransfer.files];
    if (entries.every(Boolean)) Promise.all(entries.map(inside)).then(found => queue(found.flat()), () => queue(files));
    else queue(files);
  }, true);
  document.addEventListener('click', e => {
    const button = e.target.closest ? e.target.closest('button') : null;
    const input = button && viser.upload(button);
    if (input) input.multiple = true;
  }, true);
  document.addEventListener('change', e => {
    if (e.target.type !== 'file' || e.target.files.length < 2) return;
    e.stopPropagation();
    queue([...e.target.files]);
  }, true);
  document.addEventListener('click', e => {
    const row = e.target.closest ? e.target.closest('tr[data-own]') : null;
    if (row) inputs('ROW').slice(0, 1).forEach(input => type(input, row.dataset.own));
  }, true);

  let saved = 0;
  document.addEventListener('mouseover', e => {
    const box = e.target.closest ? viser.plot(e.target) : null;
    if (!box || box.querySelector('.fv-png')) return;
    const button = document.createElement('button');
    button.className = 'fv-png';
    button.textContent = 'PNG';
    button.title = 'save this plot as a picture';
    button.onclick = () => {
      saved += 1;
      const title = box.querySelector('.u-title').textContent;
      inputs('PICTURE').slice(0, 1).forEach(input => type(input, `${saved} ${title}`));
    };
    box.append(button);
  }, true);

  // uPlot rounds to thousandths, and all smaller values would read 0
  const usual = new Intl.NumberFormat(undefined, { maximumSignificantDigits: 6 });
  const number = value => {
    if (value === null || value === undefined) return '';
    const small = value !== 0 && Math.abs(value) < 1e-3;
    const text = small ? Number(value.toPrecision(4)).toExponential() : usual.format(value || 0);
    return text.replaceAll('-', '−');
  };
  setInterval(() => viser.charts().filter(one => !one.flexvizNumbers).forEach(one => {
    one.flexvizNumbers = true;
    one.axes[1].values = (_, splits) => splits.map(number);
    one.series.slice(1).forEach(each => { each.value = (_, value) => number(value) || '--'; });
    one.redraw(false, true);
  }), 200);

  // a tooltip goes with the press, as what the press does may appear beneath it
  let pressed = null;
  document.addEventListener('mousedown', e => {
    const button = e.target.closest ? e.target.closest('button') : null;
    pressed = button && { button, x: e.clientX, y: e.clientY };
    document.documentElement.classList.toggle('fv-pressed', pressed !== null);
  }, true);
  document.addEventListener('mousemove', e => {  // not for a pointer at rest over a page that moves
    if (!pressed || Math.hypot(e.clientX - pressed.x, e.clientY - pressed.y) <= CLICK) return;
    if (pressed.button.parentElement && pressed.button.parentElement.contains(e.target)) return;
    pressed = null;
    document.documentElement.classList.remove('fv-pressed');
  }, true);

  const tip = document.createElement('div');
  tip.className = 'fv-hover';
  tip.style.display = 'none';
  document.body.append(tip);
  let waiting = false;
  const bodyUnder = e => {
    const scene = viser.scene(), nodes = viser.nodes(), canvas = scene.canvas;
    if (!canvas || !scene.camera) return null;
    const box = canvas.getBoundingClientRect();
    const bodies = Object.keys(nodes).filter(name => nodes[name] && /^\/(measured|identified|beside)\/[^/]+$/.test(name))
      .filter(name => document.querySelector(`[data-node="${CSS.escape(name.split('/')[2])}"]`));
    const ray = bodies.length ? viser.raycaster(nodes[bodies[0]]) : null;
    if (!ray) return null;
    const at = { x: (2 * (e.clientX - box.left)) / box.width - 1, y: 1 - (2 * (e.clientY - box.top)) / box.height };
    ray.setFromCamera(at, scene.camera);
    let best = null;
    for (const name of bodies) {
      const hit = ray.intersectObject(nodes[name], true)[0];
      if (hit && (!best || hit.distance < best.distance)) best = { distance: hit.distance, name };
    }
    return best && best.name.split('/')[2];
  };
  document.addEventListener('mousemove', e => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      const free = e.buttons === 0 && e.target.tagName !== 'BUTTON' && !over(e) && !viser.panel(e.target);
      const body = free ? bodyUnder(e) : null;
      const row = body && document.querySelector(`[data-node="${CSS.escape(body)}"]`);
      tip.style.display = row ? '' : 'none';
      if (row) {
        tip.textContent = row.dataset.hover;
        tip.style.left = `${Math.min(e.clientX + 14, window.innerWidth - tip.offsetWidth - 8)}px`;
        tip.style.top = `${e.clientY + 16}px`;
      }
    });
  }, true);
}
