// What makes a scene from a scene: one file each, its stem is the name users type. What it defines as
// `const Modifier kNAME` is found by its name.
#pragma once

#include "accel/contract/parameters.h"
#include "datasets/modifiers/all_modifiers.h"
#include "datasets/scene/scene.h"
