// What the shaders of the path `pipeline` tell each other.
struct Payload {
  Hit hit;
  bool collects;  // nothing is accepted, so nothing is culled, and `hit` becomes the first in (t, prim) order
};
