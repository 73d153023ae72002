// What a controller answers to a robot at rest: hold ARTIFACT SAMPLES
#include <exception>
#include <iostream>
#include <string>

#include "quasilpv/artifact.hpp"
#include "quasilpv/controller.hpp"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: hold ARTIFACT SAMPLES\n";
    return 2;
  }
  try {
    const quasilpv::Artifact artifact = quasilpv::Artifact::load(argv[1]);
    quasilpv::Controller controller(artifact);
    quasilpv::StepReport report;
    quasilpv::StepInput input;
    for (const int samples = std::stoi(argv[2]); input.seq < samples; ++input.seq) {
      report = controller.step(input);
    }
    std::cout.precision(17);
    for (std::size_t joint = 0; joint < static_cast<std::size_t>(artifact.joints()); ++joint) {
      std::cout << report.torque_applied[joint] << '\n';
    }
  } catch (const std::exception& error) {
    std::cerr << "hold: " << error.what() << '\n';
    return 2;
  }
  return 0;
}
