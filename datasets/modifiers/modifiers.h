// What makes a scene from a scene: one file each, its stem is the name users type.
#pragma once

#include "accel/contract/parameters.h"
#include "datasets/scene/scene.h"

namespace raybench {

// A new modifier is a file here plus a line in Modifiers() (load_scene.cpp).
extern const Modifier kSubdivideModifier;

}  // namespace raybench
