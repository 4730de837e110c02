// raybench explain: the Python part splits the gap between two structures.
#include "harness/cli/commands.h"
#include "harness/results/python.h"

namespace raybench {

namespace {

struct ExplainArguments {
  std::string one, other, folder, scene, rays;
  bool json = false;
};

void AddOptions(CLI::App& command, ExplainArguments& arguments) {
  command.add_option("a", arguments.one, "A structure as the run names it, such as grid")
      ->required()
      ->type_name("A");
  command.add_option("b", arguments.other, "The structure to compare with")->required()->type_name("B");
  command.add_option("dir", arguments.folder, "Result folder of a run")->required()->type_name("DIR");
  command.add_option("--scene", arguments.scene, "This scene only")->type_name("SCENE");
  command.add_option("--rays", arguments.rays, "This ray set only, such as camera")->type_name("SET");
  command.add_flag("--json", arguments.json, "For programs");
  command.footer(
      "For each scene and ray set: time per ray of A and B, how many visits, primitive tests and bytes each\n"
      "takes, what part of the gap these explain at the scene's prices (least squares over all structures "
      "that\n"
      "count), and what is left: time per each. Embree cannot count; embree_topology, its builder under a\n"
      "traversal that counts, can.\n\n"
      "Example: raybench explain grid bvh_sah results/mine --scene stadium");
}

void AddExplainCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<ExplainArguments>(
      app, invocation, "explain", "Why is one structure slower than another?", AddOptions,
      [](const ExplainArguments& arguments, const Registry&) {
        RequireFolder(arguments.folder);
        std::vector<std::string> words = {"explain", arguments.one, arguments.other, arguments.folder};
        if (!arguments.scene.empty()) words.insert(words.end(), {"--scene", arguments.scene});
        if (!arguments.rays.empty()) words.insert(words.end(), {"--rays", arguments.rays});
        if (arguments.json) words.push_back("--json");
        return Reports().Run(words);
      });
}

}  // namespace

const Command kExplain = {101, AddExplainCommand};

}  // namespace raybench
