// Shows a replica in X_ITE: every visible node has a counterpart there, and every change is made there, too.
//
// Nodes that act at the origin do not act here: time sensors, interpolators, scripts and ROUTEs have no counterpart,
// because their effects arrive as changes. A PROTO's instance is shown by the first node of its body, an Inline by a
// Group of its own.

import X3D from 'x_ite';

const MFNODE = 13, SFNODE = 12;
const NAMES = ['Bool', 'Int32', 'Float', 'Double', 'Time', 'String', 'Node', 'Color', 'ColorRGBA', 'Image', 'Vec2f', 'Vec2d', 'Vec3f',
  'Vec3d', 'Vec4f', 'Vec4d', 'Rotation', 'Matrix3f', 'Matrix3d', 'Matrix4f', 'Matrix4d'];
const kPlain = new Set([0, 1, 2, 3, 4, 5]);

/** Types whose behaviour comes from the origin. */
const kActing = ['X3DTimeDependentNode', 'X3DInterpolatorNode', 'X3DScriptNode', 'X3DSequencerNode', 'X3DTriggerNode', 'X3DFollowerNode',
  'X3DEnvironmentalSensorNode', 'X3DKeyDeviceSensorNode', 'X3DNetworkSensorNode', 'X3DPickSensorNode', 'X3DSoundNode',
  'X3DSoundSourceNode', 'X3DSoundProcessingNode', 'X3DSoundChannelNode', 'X3DInfoNode', 'X3DMetadataObject', 'X3DPhysicsModelNode'];
const kShown = new Set(['MovieTexture']);
/** Shown as a Group, because X_ITE's own nodes would load files and leave the page. */
const kGroups = new Set(['Inline', 'Anchor']);
const kLeftOut = new Set(['BooleanFilter', 'BooleanToggle', 'BooleanTrigger', 'IntegerTrigger', 'TimeTrigger', 'Script', 'CollisionSensor',
  'RigidBodyCollection', 'LoadSensor']);

/** Outputs tell what happened at the origin; they have no effect here. */
const isKept = (def) => !def.hidden && (def.access === 'initializeOnly' || def.access === 'inputOutput');

/** For fast pictures: a quarter of the pixels, and no shadows, which cost more than everything else. */
const kCoarse = {Antialiased: false, PrimitiveQuality: 'LOW', TextureQuality: 'LOW', ContentScale: 0.5};
const kNoTangents = new Error('there are no maps of normals');
/** How long the first picture waits for the scene's textures, in ms. */
const kPicturesWithin = 700;
/** Names of renderers that draw without a GPU. */
const kSoftware = /swiftshader|llvmpipe|softpipe|software|basic render/i;

export class X3dView {
  /** `pictureUrl(id, index)` is the address of a texture's url. `quality`: low, full, or by default low without a GPU.
   * */
  constructor(element, scene, {pictureUrl, quality}) {
    this.scene = scene;
    this.pictureUrl = pictureUrl;
    this.nodes = new Map();  // X_ITE's nodes by the replica's numbers
    this.canvas = X3D.createBrowser();
    this.browser = X3D.getBrowser(this.canvas);
    // Set as attributes, so that they hold before anything is laid out. They also show what is below the splash screen.
    this.canvas.setAttribute('splashScreen', 'false');
    this.canvas.setAttribute('contextMenu', 'false');
    this.canvas.setAttribute('notifications', 'false');
    this.canvas.style.visibility = 'hidden';  // until there is a picture, because composing what is shown takes time without a GPU
    element.append(this.canvas);
    // X_ITE's own fonts are for its menus and splash screen, which are not shown.
    for (const face of [...document.fonts]) if (face.family.includes('X_ITE')) document.fonts.delete(face);
    this.drawnByCpu = kSoftware.test(this.browser.getRenderer());
    this.coarse = quality === 'low' || (quality !== 'full' && this.drawnByCpu);
    if (this.coarse)
      for (const [name, value] of Object.entries(kCoarse)) this.browser.setBrowserOption(name, value);
    this.building = null;
  }

  isShown(type) {
    if (type.kind !== 'built in') return type.kind !== 'Script';
    if (kShown.has(type.name)) return true;
    return !kLeftOut.has(type.name) && !type.implements.some((name) => kActing.includes(name));
  }
  hidden(node, name) {
    const index = node.type.fields.findIndex((f) => f.name === name && f.hidden);
    return index >= 0 && index in node.values ? node.values[index] : [];
  }
  /** Returns the node itself, or for a PROTO's instance the first node of its body. */
  standIn(id) {
    for (let depth = 0; depth < 64; ++depth) {
      const node = this.scene.nodes.get(id);
      if (!node || node.type.kind === 'built in' || node.type.kind === 'Script') return id;
      id = this.hidden(node, 'body')[0] ?? 0;
    }
    return 0;
  }

  // ---- from the replica to X_ITE ---------------------------------------------------------------------------------

  /** Builds everything anew; false if another rebuild overtook this one. It reads the replica and begins to follow it
   * without a wait between. */
  async rebuild() {
    const own = this.building = {};
    const needed = new Set();
    for (const node of this.scene.nodes.values())
      if (node.type.kind === 'built in' && node.type.component && node.type.component !== 'RTSG') needed.add(node.type.component);
    const components = [];
    for (const name of needed) {
      try { components.push(this.browser.getComponent(name)); } catch { /* it has none of that name: nothing of it is shown */ }
    }
    const world = await this.browser.createScene(this.browser.getProfile('Interchange'), ...components);
    if (own !== this.building) return false;
    this.building = null;
    this.nodes.clear();
    this.world = world;
    this.chooseTangents();
    const roots = this.childrenOf(this.scene.root.get('children'));
    world.rootNodes = new X3D.MFNode(...roots);
    await this.pictures();
    if (world !== this.world) return false;
    // X_ITE reports when everything has loaded, which is much later on a slow link. The frame after the one that it
    // waits for is the first of this world.
    const replaced = this.browser.replaceWorld(world), drawn = this.browser.nextFrame().then(() => this.browser.nextFrame());
    replaced.catch(() => {});  // replaced by another world, which is fine
    await Promise.race([replaced, drawn]);
    if (world !== this.world) return false;
    this.canvas.style.visibility = '';
    return true;
  }
  /** X_ITE makes tangents for every geometry with a library that it has to load. What was drawn before is then made
   * again with other shaders. Only normal maps need tangents. */
  chooseTangents() {
    const maker = X3D.require('MikkTSpace'), kMap = 'normalTexture';
    if (!maker) return;
    delete maker.isInitialized;  // back to that of its class
    for (const {type, values} of this.scene.nodes.values())
      if (values[type.fields.findIndex((f) => f.name === kMap)]) return;
    maker.isInitialized = () => { throw kNoTangents; };  // caught where tangents would be made
  }
  /** Waits for the scene's pictures, up to a limit. A first picture without them would take as long as one with them,
   * and needs its own shaders. Changes meanwhile are followed. */
  async pictures() {
    const coming = [...this.nodes.values()].map((made) => made.getValue())
      .filter((base) => base.checkLoadState?.() === X3D.X3DConstants.IN_PROGRESS_STATE);
    const all = Promise.allSettled(coming.map((base) => base.loading()));
    await Promise.race([all, new Promise((done) => setTimeout(done, kPicturesWithin))]);
  }

  childrenOf(ids) {
    const result = [];
    for (const id of ids) {
      const node = this.make(this.standIn(id));
      if (node) result.push(node);
    }
    return result;
  }

  /** Returns X_ITE's node for this one as an SFNode; null if it is not shown. */
  make(id) {
    if (!id) return null;
    if (this.nodes.has(id)) return this.nodes.get(id);
    const node = this.scene.nodes.get(id);
    if (!node || !this.isShown(node.type)) return null;
    const inlined = node.type.name === 'Inline';
    const base = this.world.createNode(kGroups.has(node.type.name) ? 'Group' : node.type.name, false);
    if (!base) return null;
    const made = new X3D.SFNode(base);
    this.nodes.set(id, made);
    if (inlined) {
      this.setChildren(base, 'children', this.hidden(node, 'body'));
    } else {
      node.type.fields.forEach((def, index) => {
        if (index in node.values && isKept(def)) this.setField(base, node, def, index);
      });
      if (node.name) base.setUserData?.('rtsg', node.name);
    }
    base.setup();
    return made;
  }
  touchSensor() {
    const base = this.world.createNode('TouchSensor', false);
    base.setup();
    return new X3D.SFNode(base);
  }

  setChildren(base, name, ids, ...more) {
    const field = base.getField(name, false);
    if (field) field.setValue([...this.childrenOf(ids), ...more]);
  }

  setField(base, node, def, index) {
    const field = base.getField(def.name, false), k = def.type >> 1;
    let value = node.values[index];
    if (!field) return;
    if (this.coarse && def.name === 'shadows') value = false;
    if (def.type === SFNODE) return field.setValue(this.make(this.standIn(value)));
    if (def.type === MFNODE) return this.setChildren(base, def.name, value, ...(node.type.name === 'Anchor' && def.name === 'children' ? [this.touchSensor()] : []));
    if (field.getTypeName() !== (def.type % 2 ? 'MF' : 'SF') + NAMES[k]) return;
    if (def.type % 2 === 0) {
      if (kPlain.has(k)) field.setValue(value);
      else if (NAMES[k] === 'Image') field.setValue(new X3D.SFImage(value[0] ?? 0, value[1] ?? 0, value[2] ?? 0, new X3D.MFInt32(...value.slice(3))));
      else field.setValue(new X3D[`SF${NAMES[k]}`](...value));
    } else if (def.name === 'url' && node.type.implements.includes('X3DTextureNode')) {
      field.setValue(value.map((url, i) => url.startsWith('data:') ? url : this.pictureUrl(node.id, i)));
    } else if (NAMES[k] !== 'Image') {
      field.setValue(value);
    }
  }

  /** `changed` is the argument of a Scene's listener. */
  change(changed) {
    if (this.building || !this.world) return;  // the new world will have the state of when it is built
    if (this.nodes.size > this.scene.nodes.size + 1000) this.prune();
    for (let i = 0; i < changed.length; i += 2) {
      const node = changed[i], index = changed[i + 1], def = node.type.fields[index];
      if (node.id === 1) {
        if (def.name === 'children') this.world.rootNodes = new X3D.MFNode(...this.childrenOf(node.values[index]));
        continue;
      }
      if (def.name === 'body' && def.hidden && this.rewire(node)) return;
      const made = this.nodes.get(node.id);
      if (!made || !isKept(def)) continue;
      try {
        this.setField(made.getValue(), node, def, index);
      } catch (error) {
        console.warn(`${node.type.name}.${def.name}: ${error.message}`);
      }
    }
  }
  /** Call it when a body came or went. It is the content of an Inline's Group, or everything that shows a PROTO's
   * instance. */
  rewire(node) {
    if (node.type.name !== 'Inline') {
      this.rebuild();
      return true;
    }
    const made = this.nodes.get(node.id);
    if (made) this.setChildren(made.getValue(), 'children', this.hidden(node, 'body'));
    return false;
  }
  /** Numbers are never used again, so entries of destroyed nodes are dropped. */
  prune() {
    for (const id of this.nodes.keys()) if (!this.scene.nodes.has(id)) this.nodes.delete(id);
  }

  // ---- viewpoints and pointers -------------------------------------------------------------------------------------

  /** Returns [{id, name}] in the order of the document. */
  viewpoints() {
    const result = [];
    for (const [id, node] of this.scene.nodes)
      if (node.type.kind === 'built in' && node.type.implements.includes('X3DViewpointNode') && this.nodes.has(id))
        result.push({id, name: node.get('description') || node.name || `${node.type.name} ${id}`});
    return result;
  }
  /** Returns the origin's viewpoint: the top of its active layer's stack. */
  originsViewpoint() {
    const {root} = this.scene;
    return this.hidden(this.scene.nodes.get(this.hidden(root, '_activeLayer')) ?? root, '_viewpointStack')[0] ?? 0;
  }
  bind(id) {
    const made = this.nodes.get(id);
    if (made) made.set_bind = true;
  }

  /** Returns the viewer's pose as sixteen numbers, the rows right, up, back and position; null while there is no
   * picture. */
  camera() {
    const view = this.building ? null : this.browser.getActiveLayer()?.getViewpoint();
    return view ? Array.from(view.getCameraSpaceMatrix()) : null;
  }
  /** Returns the ray through a place on the page as {origin, direction} in world space; null while there is no picture.
   * */
  ray({pageX, pageY}) {
    const layer = this.building ? null : this.browser.getActiveLayer(), view = layer?.getViewpoint();
    if (!view) return null;
    const viewport = layer.getViewport().getRectangle(), near = view.getNearDistance(layer.getNavigationInfo());
    // Sixteen numbers in row order. A row vector of a place in the picture, from -1 to 1 each way, times this gives one
    // in the world.
    const m = view.getProjectionMatrixWithLimits(near, 1000 * near, viewport).copy().inverse().multRight(view.getCameraSpaceMatrix());
    const at = this.browser.getPointerFromEvent({pageX, pageY});
    const x = (at.x - viewport.x) / viewport.z * 2 - 1, y = (at.y - viewport.y) / viewport.w * 2 - 1;
    const point = (depth) => {
      const [a, b, c, w] = [0, 1, 2, 3].map((k) => x * m[k] + y * m[4 + k] + depth * m[8 + k] + m[12 + k]);
      return [a / w, b / w, c / w];
    };
    const origin = point(-1), direction = point(0).map((c, i) => c - origin[i]), length = Math.hypot(...direction);
    return length > 0 && Number.isFinite(length) ? {origin, direction: direction.map((c) => c / length)} : null;
  }
  /** Returns whether the pointer was last over something with a sensor. */
  isOverSensor() { return this.browser.getHit().sensors.size > 0; }
}
