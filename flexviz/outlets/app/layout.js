// The layout of the page: classes for its size (layout.py has the rules), the bar that takes the place of legend and
// playback, columns as tabs, the tab that follows the task, and reports of the canvas for the camera.
if (window.flexvizPage && !window.flexvizPage.layout) {
  window.flexvizPage.layout = true;
  const viser = window.flexvizViser, { tell, quiet } = window.flexvizPage, root = document.documentElement;
  const WATCH = 200, BEAT = 2000, SETTLED = 2;  // [ms], [ms], looks at the page that must agree
  const MOVE = 4;  // [px] a press may move; more turns the camera
  const make = (tag, text = '', attributes = {}) => {
    const made = document.createElement(tag);
    made.innerHTML = text;
    Object.entries(attributes).forEach(([name, value]) => made.setAttribute(name, value));
    return made;
  };
  const draw = path => `<svg width="13" height="13" viewBox="0 0 12 12"><path d="${path}"/></svg>`;
  const PLAY = draw('M2 0.5L11 6L2 11.5z'), PAUSE = draw('M1.5 1h3v10h-3zM7.5 1h3v10h-3z');
  const BACK = draw('M10.5 0.5L3.5 6L10.5 11.5zM1.5 1h1.6v10h-1.6z');
  const ON = draw('M1.5 0.5L8.5 6L1.5 11.5zM8.9 1h1.6v10h-1.6z');
  const PIN = draw('M3.5 0.5h5v1.2l-0.9 0.6v3l1.9 1.5v1.1H6.6v3.6L6 12.2L5.4 11.5V7.9H2.5V6.8l1.9-1.5v-3L3.5 1.7z');
  const stage = () => viser.dock() && viser.dock().firstElementChild;  // holds the canvas
  const named = (tag, name) => [...document.querySelectorAll(tag)].filter(one => one.textContent.trim() === name);
  const put = (target, name, value) => { if (target[name] !== value) target[name] = value; };
  const mark = (button, name, on) => button.setAttribute(name, String(on));

  const copy = (target, parts) => {
    const same = parts.length === target.childElementCount && parts.every((one, k) => one.isEqualNode(target.children[k]));
    if (!same) target.replaceChildren(...parts.map(one => one.cloneNode(true)));
  };

  // the bar
  const bar = make('div', '', { id: 'fv-bar', role: 'toolbar' });
  const button = (text, label, act, look = '') => {
    const made = make('button', text, { 'aria-label': label, title: label, type: 'button', class: look });
    made.onclick = act;
    bar.append(made);
    return made;
  };
  const play = button(PLAY, 'Play', () => tell('TRANSPORT', 'toggle'));
  button(BACK, 'Step back', () => tell('TRANSPORT', 'back'), 'fv-step');
  button(ON, 'Step forward', () => tell('TRANSPORT', 'forward'), 'fv-step');
  const slider = make('input', '', { type: 'range', step: 0.01, 'aria-label': 'Instant [s]' });
  const clock = make('output');
  const names = make('span', '', { class: 'fv-key names' }), joints = make('span', '', { class: 'fv-key' });
  let held = 0;
  slider.oninput = () => { held = Date.now(); tell('TRANSPORT', `seek ${slider.value}`); };
  bar.append(slider, clock, names, joints);
  const panels = ['Legend', 'Playback'].map(name => [name, button(name === 'Legend' ? name : 'More', name, () => {
    const now = root.dataset.fvPanel === name ? '' : name;
    if (now && root.dataset.fvColumn === 'plots') show('robots');  // it opens over the 3D view only
    root.dataset.fvPanel = now;
    look();
  })]);

  // columns as tabs
  const columns = make('div', '', { id: 'fv-columns', role: 'tablist', 'aria-label': 'Columns' });
  const tabs = [['steps', 'Steps'], ['robots', 'Robots'], ['plots', 'Plots']].map(([column, name]) => {
    const made = make('button', name, { role: 'tab', 'data-column': column, type: 'button' });
    made.onclick = () => show(column);
    columns.append(made);
    return made;
  });
  const show = column => {
    root.dataset.fvColumn = column;
    if (column !== 'robots') root.dataset.fvPanel = '';
    tabs.forEach(one => mark(one, 'aria-selected', one.dataset.column === column));
  };
  document.body.append(bar, columns);
  show('steps');

  const size = () => {
    const width = window.innerWidth, ours = Boolean(viser.dock());  // viser has a layout of its own for telephones
    root.classList.toggle('fv-barred', ours && (width < WITH_BAR || window.innerHeight < LOW));
    root.classList.toggle('fv-tabbed', ours && width < WITH_TABS);
    root.classList.toggle('fv-single', ours && width < ONE_COLUMN);
  };
  const look = () => {
    size();
    const box = stage() && stage().getBoundingClientRect();
    if (box) {
      root.style.setProperty('--fv-left', `${box.left}px`);
      root.style.setProperty('--fv-width', `${box.width}px`);
    }
    panels.forEach(([name, one]) => mark(one, 'aria-pressed', root.dataset.fvPanel === name));
    const now = document.getElementById('fv-clock');
    if (!now || !root.classList.contains('fv-barred')) return;
    const { playing, time, first, last } = now.dataset, action = playing === '1' ? 'Pause' : 'Play';
    if (play.title !== action) {
      play.innerHTML = playing === '1' ? PAUSE : PLAY;
      ['title', 'aria-label'].forEach(name => play.setAttribute(name, action));
    }
    put(slider, 'min', first);
    put(slider, 'max', last);
    if (Date.now() - held > 500) put(slider, 'value', time);
    clock.replaceChildren(time, make('span', ` / ${last}`), ' s');
    copy(names, [...document.querySelectorAll(`${viser.windows} .fv-name`)]);
    copy(joints, [...document.querySelectorAll('.fv-joint .fv-box')]);
    joints.title = [...document.querySelectorAll('.fv-joint')].map(one => one.dataset.hover).join('\n');
  };

  // the tab follows the task: the number of the element grows with each turn
  const press = tab => {  // tabs of the dock can be dragged, and so do not listen to clicks
    const box = tab.getBoundingClientRect(), at = { clientX: box.left + 5, clientY: box.top + 5 };
    ['pointerdown', 'pointerup'].forEach(kind => tab.dispatchEvent(new PointerEvent(
      kind, { bubbles: true, pointerId: 1, isPrimary: true, buttons: Number(kind === 'pointerdown'), ...at })));
  };
  let pinned = false, turn = null;
  const pin = make('button', PIN, { class: 'fv-pin', type: 'button', 'aria-label': 'Pin the tab' });
  const say = () => {
    mark(pin, 'aria-pressed', pinned);
    pin.title = pinned ? 'pinned: the tab stays; press to let it follow the task' : 'the tab follows the task; press to pin it';
  };
  pin.onclick = () => { pinned = !pinned; say(); };
  pin.onpointerdown = e => e.stopPropagation();  // the strip behind it can be dragged
  say();
  const follow = () => {
    const strip = named(viser.strips, 'Compare').map(one => one.parentElement)[0];
    if (strip && pin.parentElement !== strip) strip.append(pin);
    const shown = document.querySelector('[data-fv-turn]'), now = shown && shown.dataset.fvTurn;
    if (now && turn !== null && now !== turn && !pinned) {
      named('[role=tab]', shown.dataset.fvTab).forEach(press);
      if (root.classList.contains('fv-tabbed')) show('plots');
    }
    turn = now || turn;
  };

  // the canvas, the panels over it and the user's moves of the camera, for the camera
  let moves = 0, before = '', same = 0, sent = '', when = 0, from = null;
  const onCanvas = e => Boolean(stage() && stage().contains(e.target));
  const moved = () => { moves += 1; report(true); };
  window.addEventListener('pointerdown', e => { from = onCanvas(e) ? e : null; }, true);
  window.addEventListener('pointermove', e => {
    if (!from || !e.buttons || Math.hypot(e.clientX - from.clientX, e.clientY - from.clientY) <= MOVE) return;
    from = null;
    moved();
  }, true);
  window.addEventListener('wheel', e => { if (onCanvas(e)) moved(); }, true);
  window.addEventListener('keydown', e => {
    const typed = e.target.closest && e.target.closest('input, textarea, button, [role=slider], [role=tab]');
    if (!typed && !e.ctrlKey && !e.metaKey && /^(Key[WASDQE]|Arrow.*)$/.test(e.code)) moved();
  }, true);
  const screen = () => {
    const box = stage().getBoundingClientRect(), whole = value => Math.round(value);
    const covered = [...document.querySelectorAll(viser.windows)].map(one => one.getBoundingClientRect())
      .map(one => [Math.max(one.left, box.left) - box.left, Math.max(one.top, box.top) - box.top,
        Math.min(one.right, box.right) - box.left, Math.min(one.bottom, box.bottom) - box.top])
      .filter(([left, top, right, bottom]) => right > left && bottom > top);
    return [whole(box.width), whole(box.height), moves, ...covered.map(one => one.map(whole).join(','))].join(' ');
  };
  const report = now => {
    if (!stage()) return;
    const text = screen(), due = Date.now() - when > BEAT;
    same = text === before ? same + 1 : 0;
    before = text;
    if (!now && (!quiet() || (!due && (text === sent || same < SETTLED)))) return;
    [sent, when] = [text, Date.now()];
    tell('SCREEN', text);
  };
  window.addEventListener('resize', look);
  setInterval(() => {
    look();
    follow();
    requestAnimationFrame(() => report(false));  // a hidden page has no frames, and so reports nothing
  }, WATCH);
  look();
}
