// All that the page's scripts know of viser's inside; viser_private.py has the rest, and the version.
if (!window.flexvizViser) {
  const scene = () => window.__viserMutable || {};
  window.flexvizViser = {
    scene,  // with canvas, camera and requestRender, once it is drawn
    nodes: () => scene().nodeRefFromName || {},  // objects of three.js by their names
    raycaster: node => node.__r3f && node.__r3f.root && node.__r3f.root.getState().raycaster,
    charts: () => Object.values((window.__viserTestpoints || {}).uplots || {}).map(one => one.chart),
    send: (control, value) => {
      const send = scene().sendMessage;
      if (send) send({ type: 'GuiUpdateMessage', uuid: control, updates: { value } });
    },
    typed: input => {  // the id of the control whose text this is
      const row = input.matches('.mantine-TextInput-input') && input.closest('.mantine-Flex-root');
      const label = row && row.querySelector('label[for]');
      return label ? label.htmlFor : null;
    },
    control: label => label.closest('.mantine-Flex-root'),
    upload: button => document.getElementById(`file_upload_${button.id}`),
    plot: place => place.closest('.uplot-container'),
    panel: place => place.closest('[data-dock-group]'),
    dock: () => document.querySelector('[data-dock-root]'),
    strips: '[data-dock-region] [role=tab]',  // the tabs of the docks
    windows: '[data-floating-window]',
  };
}
