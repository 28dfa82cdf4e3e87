SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 2, 1, 1};
Box(2) = {0, 0, 1, 1, 1, 1};
BooleanFragments{ Volume{1}; Delete; }{ Volume{2}; Delete; }
Physical Volume("table") = {1};
Physical Volume("tool") = {2};
e = 1e-3;
Physical Surface("bottom") = Surface In BoundingBox{-e, -e, -e, 2 + e, 1 + e, e};
Physical Surface("top") = Surface In BoundingBox{-e, -e, 2 - e, 1 + e, 1 + e, 2 + e};
Physical Surface("interface") = Surface In BoundingBox{-e, -e, 1 - e, 1 + e, 1 + e, 1 + e};
Mesh.CharacteristicLengthMin = 1;
Mesh.CharacteristicLengthMax = 1;
