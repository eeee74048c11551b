"""A second simulator with hidden effects, sharing no code with flexviz.

Rigid links are MuJoCo's; motors, joints, friction, sensors, controller and files are written here, from the
same equations on paper, not from the package. Nothing in this folder imports flexviz: what flexviz finds in
these data is not its own echo.
"""
