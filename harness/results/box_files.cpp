#include "harness/results/box_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <vector>

#include "accel/base/error.h"
#include "accel/base/files.h"
#include "harness/base/json.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

using OnNode = std::function<void(const rb_node&)>;

void Visit(const Tree& tree, const OnNode& on_node) {
  tree.structure().visit(
      tree.get(),
      [](void* context, const rb_node* node) {
        (*static_cast<const OnNode*>(context))(*node);
        return 0;
      },
      const_cast<OnNode*>(&on_node));
}

/// Six digits are enough to draw, and a third of the file.
double Short(float value) { return std::strtod(fmt::format("{:.6g}", value).c_str(), nullptr); }

bool IsBox(const rb_node& node) { return node.shape == RB_SHAPE_BOX && node.bounds_count == 6; }

Json ReadBoxFile(const fs::path& path) {
  std::ifstream file(path);
  Json content =
      file ? Json::parse(file, nullptr, /*allow_exceptions=*/false) : Json{{"trees", Json::array()}};
  if (!content.is_object() || !content.contains("trees"))
    throw InputError(path.string() + ": not a file of boxes; remove it");
  return content;
}

}  // namespace

void AddBoxes(const fs::path& path, const std::string& spec, const Tree& tree, size_t most) {
  if (tree.structure().visit == nullptr) return;
  std::vector<size_t> sizes;  // boxes of each level
  bool all_boxes = true;
  Visit(tree, [&](const rb_node& node) {
    if (sizes.size() <= node.depth) sizes.resize(node.depth + 1);
    ++sizes[node.depth];
    all_boxes &= IsBox(node);
  });
  if (!all_boxes || sizes.empty() || sizes[0] != 1) return;
  size_t levels = 0, sum = 0;
  while (levels < sizes.size() && (sum += sizes[levels]) <= most) ++levels;
  Json shown = Json::array();
  for (size_t i = 0; i < levels; ++i) shown.push_back(Json::array());
  Visit(tree, [&](const rb_node& node) {
    if (node.depth >= levels) return;
    Json box = Json::array();
    for (uint32_t i = 0; i < 6; ++i) box.push_back(Short(node.bounds[i]));
    box.push_back(node.is_leaf != 0 ? 1 : 0);
    shown[node.depth].push_back(std::move(box));
  });
  Json content = ReadBoxFile(path);
  Json& trees = content["trees"];
  if (std::any_of(trees.begin(), trees.end(), [&](const Json& t) { return t.value("spec", "") == spec; }))
    return;
  trees.push_back({{"spec", spec}, {"depth", sizes.size() - 1}, {"levels", std::move(shown)}});
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  if (error) throw InputError(path.parent_path().string() + ": cannot be made: " + error.message());
  WriteFileAtomically(path, content.dump() + "\n");
}

}  // namespace raybench
