// What a controller answers to a robot at rest on its reference: hold ARTIFACT ANGLE_RAD SAMPLES
#include <exception>
#include <iostream>
#include <string>

#include "quasilpv/artifact.hpp"
#include "quasilpv/controller.hpp"

int main(int argc, char** argv) {
  if (argc != 4) {
    std::cerr << "usage: hold ARTIFACT ANGLE_RAD SAMPLES\n";
    return 2;
  }
  try {
    const quasilpv::Artifact artifact = quasilpv::Artifact::load(argv[1]);
    quasilpv::Controller controller(artifact);
    quasilpv::StepReport report;
    quasilpv::StepInput input;
    input.angle.fill(std::stod(argv[2]));
    input.reference.angle = input.angle;
    for (const int samples = std::stoi(argv[3]); input.seq < samples; ++input.seq) {
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
