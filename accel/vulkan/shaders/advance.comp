// Between two waves: the size of the next one, which its shaders have counted, becomes the arguments of its dispatch.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "picture.glsl"

void main() {
  const uint rays = min(push.picture.waves.at[push.wave].rays, push.picture.capacity);
  push.picture.waves.at[push.wave].x = (rays + 63) / 64;
  push.picture.waves.at[push.wave].y = 1;
  push.picture.waves.at[push.wave].z = 1;
}
