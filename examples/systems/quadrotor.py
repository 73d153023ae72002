"""The attitude of a quadrotor: three Euler angles and the rates of the body, three torques.

    p' = (Iy - Iz)/Ix q r + tx/Ix,    q' = (Iz - Ix)/Iy p r + ty/Iy,    r' = (Ix - Iy)/Iz p q + tz/Iz
    ph' = p + sin(ph) tan(te) q + cos(ph) tan(te) r,    te' = cos(ph) q - sin(ph) r
    cos(te) ps' = sin(ph) q + cos(ph) r

ph, te, ps: roll, pitch, yaw, rad; p, q, r: rates of the body, rad/s; tx, ty, tz: torques, N m.
Ix = Iy = 0.005, Iz = 0.009 kg m^2. Source: Beard and McLain, Small Unmanned Aircraft, 2012, chapter 3.

    design synth examples/systems/quadrotor.py:attitude -o out/quadrotor
    design simulate out/quadrotor/artifact.json --start ph=0.1 --start te=-0.1
"""

import quasilpv as ql


def attitude(angle_rad: float = 0.4, rate_rad_s: float = 2.0, torque_nm: float = 1.0) -> ql.DescriptorSystem:
    """Roll and pitch within `angle_rad`, rates within `rate_rad_s`."""
    return ql.DescriptorSystem.from_equations(
        [
            "cos(te)*ph' = cos(te)*p + sin(ph)*sin(te)*q + cos(ph)*sin(te)*r",
            "te' = cos(ph)*q - sin(ph)*r",
            "cos(te)*ps' = sin(ph)*q + cos(ph)*r",
            "0.005*p' = -0.004*q*r + tx",
            "0.005*q' = 0.004*p*r + ty",
            "0.009*r' = tz",
        ],
        name="quadrotor-attitude",
        state="ph te ps p q r",
        inputs="tx ty tz",
        domain={
            "ph": (-angle_rad, angle_rad),
            "te": (-angle_rad, angle_rad),
            "ps": (-3, 3),
            "p": (-rate_rad_s, rate_rad_s),
            "q": (-rate_rad_s, rate_rad_s),
            "r": (-rate_rad_s, rate_rad_s),
        },
    )
