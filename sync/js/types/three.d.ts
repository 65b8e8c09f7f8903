// The types of `rtsg/three`: a replica of a scene as a THREE.Group. It needs three.js (0.160 or later) and its WebGLRenderer.

import type {AmbientLight, Camera, Color, DirectionalLight, Fog, FogExp2, Group, Object3D} from 'three';
import type {Mirror, Scene} from './index.js';

export interface ReplicaOptions {
  /** The address of a texture's url: of which node, and which of its urls. null: this one is not loaded. By default only what the
   * scene itself holds (`data:`). */
  pictureUrl?: (id: number, index: number, url: string) => string | null;
  /** Told what cannot be shown; by default it is on the console. */
  onTrouble?: (text: string) => void;
  /** So many meshes of one geometry and one material are drawn as one InstancedMesh; 16 by default. */
  batch?: number;
}

/** Shows a scene, and follows its changes: only objects that a change is about are touched. Each object of three.js stands for one path
 * to a node, whose number is in its `userData.id` and whose DEF is its name. */
export class Replica extends Group {
  constructor(scene: Scene, options?: ReplicaOptions);
  readonly scene: Scene;
  /** On while the NavigationInfo that is bound has a headlight; update() moves it. */
  readonly headlight: DirectionalLight;
  readonly ambient: AmbientLight;
  /** What is bound at the origin; update() gives both to the THREE.Scene that this is a child of. */
  readonly background: Color | null;
  readonly fog: Fog | FogExp2 | null;
  /** The objects of each node, by its number. */
  readonly objects: ReadonlyMap<number, ReadonlySet<Object3D>>;
  /** Builds everything anew. */
  rebuild(): void;
  /** Takes what a Scene's listener is told; the constructor sees to it. */
  change(changed: readonly unknown[]): void;
  /** Call it before each picture. */
  update(camera: Camera): void;
  viewpoints(): {id: number; name: string}[];
  /** Places a camera at a viewpoint, by default the one that is bound at the origin; returns its number, 0 for X3D's default. */
  look(camera: Camera, aspect?: number, id?: number): number;
  /** The ray through a place on the page, in the scene's space; null where there is none. */
  ray(event: {clientX: number; clientY: number}, camera: Camera, element: Element): {origin: number[]; direction: number[]} | null;
  /** Sends what a mouse, a pen or a finger does on `element` to the origin, whose sensors act. Give the verdicts that the mirror is told
   * to its answered(), and call its welcome() at each welcome. */
  point(element: HTMLElement, mirror: Mirror, camera: Camera): {answered(verdict: {request: number; reason: string}): boolean; welcome(): void; leave(): void};
  /** Stops following, and frees what the graphics card holds. */
  dispose(): void;
}
