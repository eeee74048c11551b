// Terms are explained where they stand: the first one of each panel is underlined, and its explanation opens under the
// pointer, under a finger, and when the keyboard reaches it. The page's texts bring the explanations (`with_terms`).
if (!window.flexvizTerms) {
  window.flexvizTerms = true;
  const tip = document.createElement('div');
  tip.className = 'fv-hover fv-told';
  tip.setAttribute('role', 'tooltip');
  tip.id = 'fv-told';
  tip.style.display = 'none';
  document.body.append(tip);
  let of = null;
  const close = () => { tip.style.display = 'none'; of = null; };
  const open = term => {
    of = term;
    tip.textContent = term.dataset.told;
    tip.style.display = '';
    const box = term.getBoundingClientRect();
    const below = box.bottom + 4 + tip.offsetHeight < window.innerHeight;
    tip.style.left = `${Math.max(Math.min(box.left, window.innerWidth - tip.offsetWidth - 8), 8)}px`;
    tip.style.top = `${below ? box.bottom + 4 : box.top - tip.offsetHeight - 4}px`;
  };
  const panel = term => term.closest('[role=tabpanel]') || window.flexvizViser.panel(term) || document.body;
  const mark = () => {
    if (of && !of.isConnected) close();
    const told = new Map();
    for (const term of document.querySelectorAll('.fv-term')) {
      if (term.title) {  // else the browser shows it, too, but not to the keyboard
        term.dataset.told = term.title;
        term.removeAttribute('title');
        term.setAttribute('aria-description', term.dataset.told);
      }
      const here = panel(term), known = told.get(here) || told.set(here, new Set()).get(here);
      const first = !known.has(term.dataset.told) && term.checkVisibility();
      if (first) known.add(term.dataset.told);
      if (first === term.classList.contains('fv-first')) continue;
      term.classList.toggle('fv-first', first);
      first ? term.setAttribute('tabindex', '0') : term.removeAttribute('tabindex');
    }
  };
  setInterval(mark, 300);  // what is shown changes without an event: tabs, folders, texts
  const under = e => (e.target.closest ? e.target.closest('.fv-first') : null);
  document.addEventListener('mouseover', e => { if (under(e)) open(under(e)); else if (of && of !== document.activeElement) close(); }, true);
  document.addEventListener('focusin', e => { if (under(e)) open(under(e)); else close(); }, true);
  document.addEventListener('focusout', close, true);
  document.addEventListener('scroll', close, true);
  document.addEventListener('keydown', e => { if (e.key === 'Escape') close(); }, true);
}
