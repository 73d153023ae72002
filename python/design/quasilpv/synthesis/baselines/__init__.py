"""What the laws are compared with: PID and computed torque, with the printed gains and tuned."""
