// rtsg/three: a replica as a THREE.Group.

export {Replica} from './replica.js';
