"""A script as users write it, for `mypy --strict` against the installed package: what comes back has types."""

import quasilpv as ql

system = ql.DescriptorSystem.from_equations(
    ["x' = w", "w' = a*sin(x) - w + u"], state="x w", inputs="u", domain={"x": (-1, 1), "a": (9, 11)}, unknown="a"
)
answer: ql.Answer = ql.solve(system, "II.5", decay_rate=1.0)
margin: float | None = ql.gate(ql.design("arm2", rate_hz=1000).release()).delay_margin_s
print(answer.headline, answer.verdict is ql.Verdict.FEASIBLE, margin)
